// Which vertices are water: those of class 9, where vertices carry their class or its colour, and those on the shores of lakes, which
// breaklines.csv lists. A lake has no points inside, so that a triangle is water if all its corners are.
import { BufferAttribute, Color, Vector3 } from 'three';
import { WATER_COLOR } from './surface.js';

const WATER = 9;
const { r: RED, g: GREEN, b: BLUE } = new Color(WATER_COLOR);
// Tiles may hold colours in eight linear bits.
const NEAR = 1.5 / 255;
// Lists of more lines take long to load; lakes then look like land.
const MOST_BYTES = 32e6;

// Returns the places of lakes' vertices in lattice steps: a set of y for each x.
function placesOf(list, { offset, steps }) {
  const places = new Map();
  for (const line of list.split('\n')) {
    if (!line.endsWith(',lake')) continue;
    const values = line.split(',').map(Number);
    for (const at of [0, 3]) {
      const [x, y] = [0, 1].map((axis) => Math.round((values[at + axis] - offset[axis]) / steps[axis]));
      if (!places.has(x)) places.set(x, new Set());
      places.get(x).add(y);
    }
  }
  return places;
}

export class Water {
  constructor(list = '') {
    this.list = list;
  }

  // Loads the list of breaklines beside the terrain, if its report says that there is one.
  static async load(report) {
    if (!report?.breaklines?.features) return new Water();
    try {
      const answer = await fetch('breaklines.csv');
      const isSmall = Number(answer.headers.get('content-length') ?? 0) <= MOST_BYTES;
      if (answer.ok && isSmall) return new Water(await answer.text());
      await answer.body?.cancel();
    } catch {
      // Without the list, lakes look like land.
    }
    return new Water();
  }

  // Returns for each vertex 1 if it is water, else 0; null if none is.
  attribute({ attributes: { position, color, _classification: classes } }, toScene, georeference) {
    this.places ??= placesOf(this.list, georeference);
    if (!classes && !color && this.places.size === 0) return null;
    const isShown = (i) => Math.abs(color.getX(i) - RED) < NEAR && Math.abs(color.getY(i) - GREEN) < NEAR && Math.abs(color.getZ(i) - BLUE) < NEAR;
    const isWater = new Uint8Array(position.count);
    const vertex = new Vector3();
    for (let i = 0; i < position.count; i += 1) {
      if (classes?.getX(i) === WATER || (color && isShown(i))) isWater[i] = 255;
      else if (this.places.size && this.isOnShore(georeference.step(vertex.fromBufferAttribute(position, i).applyMatrix4(toScene).toArray()))) isWater[i] = 255;
    }
    return isWater.some(Boolean) ? new BufferAttribute(isWater, 1, true) : null;
  }

  isOnShore([x, y]) {
    return Boolean(this.places.get(x)?.has(y));
  }
}
