// Where the camera must be to see all of some places.
import { MathUtils, Vector3 } from 'three';

// The share of the window that stays free at each edge.
const MARGIN = 0.04;

// Returns the position from which a camera that looks along `forward` sees all places as large as possible, and whether the height of the window
// limits that, not its width. Each pair of opposite planes of the
// frustum moves until it touches the outermost places; the pair that needs more distance decides.
export function fittingView(places, forward, { fov, aspect }) {
  const right = new Vector3().crossVectors(forward, new Vector3(0, 1, 0)).normalize();
  const up = new Vector3().crossVectors(right, forward);
  const upright = Math.tan(MathUtils.degToRad(fov / 2)) * (1 - 2 * MARGIN);
  const fits = [[right, upright * aspect], [up, upright]].map(([axis, slope]) => {
    const reach = (sign) => Math.max(...places.map((place) => sign * place.dot(axis) - slope * place.dot(forward)));
    const [ahead, behind] = [reach(1), reach(-1)];
    return { sideways: (ahead - behind) / 2, depth: -(ahead + behind) / (2 * slope) };
  });
  const [wide, high] = fits;
  const position = new Vector3()
    .addScaledVector(right, wide.sideways)
    .addScaledVector(up, high.sideways)
    .addScaledVector(forward, Math.min(wide.depth, high.depth));
  return { position, isHighest: high.depth <= wide.depth };
}
