// How the terrain looks: one shader for all ways of colouring it. Colours and lights are reckoned in the frame of the glTF scene, whose
// y is the height in the source, wherever on the globe a tile lies. Where a scene follows the curve of the earth, `lift` is taken off.
import { Color, DoubleSide, Matrix3, Matrix4, ShaderMaterial } from 'three';

export const MODES = ['points', 'height', 'slope', 'levels'];

// Ends of the ramps are told apart also by people who see few colours.
export const HEIGHT_COLORS = ['#30123b', '#3f6fd8', '#1bc8c4', '#7ee04a', '#f3c63a', '#e4572a'];
export const SLOPE_COLORS = ['#f7f4e6', '#f2dc8f', '#f0ab4f', '#dd6a3d', '#a8324f', '#4b1d5c'];
export const STEEPEST_DEGREES = 60;
// From the coarsest level on. The exact tiles have a colour of their own.
export const LEVEL_COLORS = ['#e15759', '#f28e2b', '#edc948', '#59a14f', '#4e79a7', '#b07aa1', '#9c755f', '#ff9da7'];
export const EXACT_COLOR = '#c9d3dc';

const linear = (colors) => colors.map((color) => new Color(color));

const VERTEX = `
uniform mat4 toScene;
uniform mat3 toSceneNormal;
varying float height;
varying vec3 place;
varying vec3 upright;
varying vec3 pointColor;
uniform vec3 plainColor;
#ifdef IS_BENT
  attribute float lift;
#endif
void main() {
  height = (toScene * vec4(position, 1.0)).y;
  #ifdef IS_BENT
    height -= lift;
  #endif
  place = mat3(toScene) * position;
  #ifdef HAS_NORMALS
    upright = toSceneNormal * normal;
  #endif
  #ifdef USE_COLOR
    pointColor = color.rgb;
  #else
    pointColor = plainColor;
  #endif
  gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
}`;

const FRAGMENT = `
uniform int mode;
uniform bool shaded;
uniform vec2 heightRange;
uniform vec3 heightColors[6];
uniform vec3 slopeColors[6];
uniform vec3 levelColor;
varying float height;
varying vec3 place;
varying vec3 upright;
varying vec3 pointColor;
vec3 ramp(vec3 colors[6], float share) {
  float at = clamp(share, 0.0, 1.0) * 5.0;
  vec3 color = colors[0];
  for (int i = 1; i < 6; i++) color = mix(color, colors[i], clamp(at - float(i - 1), 0.0, 1.0));
  return color;
}
void main() {
  #ifdef HAS_NORMALS
    vec3 up = normalize(upright);
  #else
    vec3 up = normalize(cross(dFdx(place), dFdy(place)));
    if (up.y < 0.0) up = -up;
  #endif
  vec3 color = pointColor;
  if (mode == 1) color = ramp(heightColors, (height - heightRange.x) / max(heightRange.y - heightRange.x, 1e-6));
  if (mode == 2) color = ramp(slopeColors, degrees(acos(clamp(up.y, 0.0, 1.0))) / ${STEEPEST_DEGREES.toFixed(1)});
  if (mode == 3) color = levelColor;
  // The sun is in the north-west, as on maps.
  float light = dot(up, normalize(vec3(-0.6, 0.9, -0.6)));
  if (shaded) color *= 0.42 + 0.12 * up.y + 0.62 * max(light, 0.0);
  gl_FragColor = vec4(color, 1.0);
  #include <colorspace_fragment>
}`;

const EDGE_FRAGMENT = `
uniform vec4 edgeColor;
void main() { gl_FragColor = edgeColor; }`;

export class Surface {
  constructor() {
    // All materials share these, so that one change is seen everywhere.
    this.shared = {
      mode: { value: 0 },
      shaded: { value: true },
      heightRange: { value: [0, 1] },
      heightColors: { value: linear(HEIGHT_COLORS) },
      slopeColors: { value: linear(SLOPE_COLORS) },
    };
    this.edges = new ShaderMaterial({
      uniforms: { edgeColor: { value: [0.02, 0.03, 0.05, 0.45] } },
      vertexShader: 'void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }',
      fragmentShader: EDGE_FRAGMENT,
      wireframe: true,
      transparent: true,
      depthWrite: false,
    });
  }

  // Returns the material of a mesh. `toScene` leads from its own frame to that of its glTF scene.
  material(mesh, toScene, levelColor) {
    const { normal, color, lift } = mesh.geometry.attributes;
    return new ShaderMaterial({
      uniforms: {
        ...this.shared,
        toScene: { value: toScene.clone() },
        toSceneNormal: { value: new Matrix3().getNormalMatrix(toScene) },
        plainColor: { value: mesh.material.color.clone() },
        levelColor: { value: new Color(levelColor) },
      },
      defines: { ...(normal && { HAS_NORMALS: '' }), ...(lift && { IS_BENT: '' }) },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      vertexColors: Boolean(color),
      side: DoubleSide,
      // So that edges lie in front of their own triangles.
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
  }
}

// Returns the matrix from the frame of `mesh` to that of `scene`, the glTF scene above it.
export function matrixToScene(mesh, scene) {
  const matrix = new Matrix4();
  for (let node = mesh; node !== scene; node = node.parent) {
    node.updateMatrix();
    matrix.premultiply(node.matrix);
  }
  return matrix;
}
