// Heights along the ruler: where it crosses the triangles that are on the screen. All lengths are in units of the source.
import { Vector3 } from 'three';
import { byId, count, unitName } from './dom.js';

const SVG = 'http://www.w3.org/2000/svg';
// The drawing, in its own units, and the room beside it for the numbers.
const [WIDTH, HEIGHT, LEFT, BOTTOM, TOP] = [300, 150, 48, 20, 8];
// Pieces that are apart by more than this share of the line have nothing between them.
const GAP = 1e-6;

// Returns the flat places of a mesh's vertices, x, y and z of the source for each, relative to its offset.
function placesOf({ geometry: { attributes: { position } }, userData: { toScene } }, georeference) {
  const places = new Float64Array(3 * position.count);
  const vertex = new Vector3();
  for (let i = 0; i < position.count; i += 1) {
    const flat = georeference.flat(vertex.fromBufferAttribute(position, i).applyMatrix4(toScene).toArray());
    for (let axis = 0; axis < 3; axis += 1) places[3 * i + axis] = flat[axis] / georeference.metres[axis];
  }
  return places;
}

// Returns the pieces of the surface of a mesh above the segment from `a` to `b`: [share, z, share, z] each, with shares of the segment from 0 to 1.
function piecesOf(mesh, places, [ax, ay], [bx, by]) {
  const { index } = mesh.geometry;
  const [dx, dy] = [bx - ax, by - ay];
  const squared = dx * dx + dy * dy;
  const corner = (k) => 3 * (index ? index.getX(k) : k);
  // On which side of the line a corner lies, and how far.
  const aside = (at) => dx * (places[at + 1] - ay) - dy * (places[at] - ax);
  const along = (at) => (dx * (places[at] - ax) + dy * (places[at + 1] - ay)) / squared;
  const pieces = [];
  const total = index ? index.count : places.length / 3;
  for (let k = 0; k + 2 < total; k += 3) {
    const corners = [corner(k), corner(k + 1), corner(k + 2)];
    const sides = corners.map(aside);
    const isLeft = sides.map((side) => side >= 0);
    if (isLeft[0] === isLeft[1] && isLeft[1] === isLeft[2]) continue;
    const ends = [0, 1, 2].filter((i) => isLeft[i] !== isLeft[(i + 1) % 3]).map((i) => {
      const [p, q] = [i, (i + 1) % 3];
      const share = sides[p] / (sides[p] - sides[q]);
      const mix = (of) => of(corners[p]) + share * (of(corners[q]) - of(corners[p]));
      return [mix(along), mix((at) => places[at + 2])];
    }).sort(([first], [second]) => first - second);
    const piece = within(ends);
    if (piece) pieces.push(piece);
  }
  return pieces;
}

// Cuts a piece at the ends of the segment; null if nothing of it is left.
function within([[from, low], [to, high]]) {
  if (to <= 0 || from >= 1 || to <= from) return null;
  const at = (share) => low + ((share - from) / (to - from)) * (high - low);
  const [begin, end] = [Math.max(from, 0), Math.min(to, 1)];
  return [begin, at(begin), end, at(end)];
}

// Joins pieces to rows of [share, z]; a row without z is where nothing is on the screen.
function join(pieces) {
  const rows = [];
  let reached = 0;
  for (const [from, low, to, high] of pieces.sort((one, other) => one[0] - other[0])) {
    if (from > reached + GAP) rows.push([reached, null], [from, null]);
    if (rows.length === 0 || from > reached + GAP) rows.push([from, low]);
    if (to > reached) rows.push([to, high]);
    reached = Math.max(reached, to);
  }
  if (reached < 1 - GAP) rows.push([reached, null], [1, null]);
  return rows;
}

// Returns the rows of a profile along places in source coordinates: { distance, x, y, z }, with z null where nothing is on the screen. The distance
// is along the plane.
export function profileAlong(line, meshes, georeference) {
  const [ox, oy, oz] = georeference.offset;
  const flat = line.map(([x, y]) => [x - ox, y - oy]);
  const all = meshes.map((mesh) => [mesh, placesOf(mesh, georeference)]);
  let start = 0;
  return flat.slice(1).flatMap((b, i) => {
    const a = flat[i];
    const span = Math.hypot(b[0] - a[0], b[1] - a[1]);
    if (span === 0) return [];
    const rows = join(all.flatMap(([mesh, places]) => piecesOf(mesh, places, a, b))).map(([share, z]) => ({
      distance: start + share * span,
      x: line[i][0] + share * (b[0] - a[0]),
      y: line[i][1] + share * (b[1] - a[1]),
      z: z === null ? null : z + oz,
    }));
    start += span;
    return rows;
  });
}

// Returns the rows as CSV, with the columns of `gdt-batch profile`.
export function csvOf(rows, georeference) {
  const digits = [0, 0, 1, 2].map((axis) => georeference.places(axis));
  const line = ({ distance, x, y, z }) => [distance, x, y, z].map((value, i) => (value === null ? '' : value.toFixed(digits[i]))).join(',');
  return `distance,x,y,z\n${rows.map(line).join('\n')}\n`;
}

function svg(tag, attributes, text = '') {
  const made = document.createElementNS(SVG, tag);
  Object.entries(attributes).forEach(([name, value]) => made.setAttribute(name, value));
  made.textContent = text;
  return made;
}

// The chart of a profile in the panel.
export class ProfileChart {
  constructor(georeference, save) {
    Object.assign(this, { georeference, rows: [] });
    [this.flatUnit, , this.upUnit] = georeference.metres.map((metres) => unitName(metres));
    byId('profile-save').addEventListener('click', () => save(new Blob([csvOf(this.rows, georeference)], { type: 'text/csv' }), 'profile.csv'));
    byId('profile-chart').addEventListener('pointermove', (event) => this.tell(event));
    byId('profile-chart').addEventListener('pointerleave', () => this.describe());
  }

  // Shows rows, or hides the chart if there are none with a height. `ends` are the distances of the places of the ruler between its ends.
  show(rows, ends) {
    this.rows = rows;
    const heights = rows.map(({ z }) => z).filter((z) => z !== null);
    byId('profile').hidden = heights.length === 0;
    if (heights.length === 0) return;
    this.low = heights.reduce((least, z) => Math.min(least, z), Infinity);
    this.high = heights.reduce((most, z) => Math.max(most, z), -Infinity);
    this.length = rows.at(-1).distance;
    byId('profile-chart').replaceChildren(...this.axes(), ...ends.map((distance) => this.upright(distance)), this.line(), this.cursor = this.upright(0, 'cursor'));
    this.cursor.setAttribute('visibility', 'hidden');
    this.describe();
  }

  x(distance) {
    return LEFT + (distance / this.length) * (WIDTH - LEFT - 4);
  }

  y(z) {
    const span = Math.max(this.high - this.low, 1e-9);
    return HEIGHT - BOTTOM - ((z - this.low) / span) * (HEIGHT - BOTTOM - TOP);
  }

  axes() {
    const bottom = HEIGHT - BOTTOM;
    const digits = this.high - this.low < 10 ? 2 : 1;
    const text = (x, y, anchor, words) => svg('text', { x, y, 'text-anchor': anchor }, words);
    return [
      svg('path', { class: 'axis', d: `M${LEFT} ${TOP}V${bottom}H${WIDTH - 4}` }),
      text(LEFT - 4, TOP + 6, 'end', this.high.toFixed(digits)),
      text(LEFT - 4, bottom, 'end', this.low.toFixed(digits)),
      text(LEFT, HEIGHT - 6, 'start', '0'),
      text(WIDTH - 4, HEIGHT - 6, 'end', `${this.length.toFixed(this.length < 100 ? 1 : 0)} ${this.flatUnit}`.trim()),
    ];
  }

  upright(distance, name = 'place') {
    const x = this.x(distance).toFixed(2);
    return svg('path', { class: name, d: `M${x} ${TOP}V${HEIGHT - BOTTOM}` });
  }

  line() {
    let isOpen = false;
    const d = this.rows.map(({ distance, z }) => {
      const command = isOpen && z !== null ? 'L' : 'M';
      isOpen = z !== null;
      return isOpen ? `${command}${this.x(distance).toFixed(2)} ${this.y(z).toFixed(2)}` : '';
    }).join('');
    return svg('path', { class: 'profile', d });
  }

  describe() {
    this.cursor.setAttribute('visibility', 'hidden');
    const gaps = this.rows.some(({ z }) => z === null) ? ' No tile is shown where the line is broken.' : '';
    const unit = this.upUnit ? ` ${this.upUnit}` : '';
    const text = `Heights from ${this.low.toFixed(2)} to ${this.high.toFixed(2)}${unit}, from the tiles on the screen: ${count(this.rows.length)} places.${gaps}`;
    byId('profile-hint').textContent = text;
    byId('profile-chart').setAttribute('aria-label', text);
  }

  // Tells the height under the pointer.
  tell({ clientX }) {
    const { left, width } = byId('profile-chart').getBoundingClientRect();
    const x = ((clientX - left) / width) * WIDTH;
    const distance = Math.min(Math.max((x - LEFT) / (WIDTH - LEFT - 4), 0), 1) * this.length;
    const next = this.rows.findIndex((row) => row.distance >= distance);
    const [to, from] = [this.rows[next], this.rows[Math.max(next - 1, 0)]];
    if (!to || to.z === null || from.z === null) return;
    const share = to.distance > from.distance ? (distance - from.distance) / (to.distance - from.distance) : 0;
    const z = from.z + share * (to.z - from.z);
    this.cursor.setAttribute('d', this.upright(distance).getAttribute('d'));
    this.cursor.setAttribute('visibility', 'visible');
    byId('profile-hint').textContent = `${distance.toFixed(1)} ${this.flatUnit}: height ${z.toFixed(2)} ${this.upUnit}`.trim();
  }
}
