// The ruler: a line over the places that were clicked, and its lengths, from the coordinates of the source.
import { BufferGeometry, Float32BufferAttribute, Line, LineBasicMaterial } from 'three';
import { byId, element, length, unitName } from './dom.js';

// Returns a length in metres, and in a unit of so many metres where that is another one.
function lengthText(metres, unit) {
  const name = unitName(unit);
  return unit === 1 || !name ? length(metres) : `${length(metres)} (${(metres / unit).toFixed(1)} ${name})`;
}

export class Ruler {
  constructor(scene, terrain, changed) {
    Object.assign(this, { terrain, changed, isOn: false, places: [], version: 0 });
    this.line = new Line(new BufferGeometry(), new LineBasicMaterial({ color: '#ff2d95', depthTest: false, transparent: true }));
    this.line.frustumCulled = false;
    this.line.renderOrder = 2;
    scene.add(this.line);
  }

  start() {
    this.isOn = true;
    this.clear();
  }

  stop() {
    this.isOn = false;
    this.clear();
  }

  clear() {
    this.places = [];
    this.draw();
  }

  undo() {
    this.places.pop();
    this.draw();
  }

  // Adds a place; returns it, so that it can be corrected.
  add({ source, world }) {
    const place = { source, world };
    this.places.push(place);
    this.draw();
    return place;
  }

  has(place) {
    return this.places.includes(place);
  }

  // Corrects a place, unless it was removed meanwhile.
  correct(place, { source, world }) {
    if (!this.has(place)) return;
    Object.assign(place, { source, world });
    this.draw();
  }

  draw() {
    const corners = this.places.flatMap(({ world }) => world.toArray());
    this.line.geometry.dispose();
    this.line.geometry = new BufferGeometry().setAttribute('position', new Float32BufferAttribute(corners, 3));
    this.write();
    this.version += 1;
    this.changed();
  }

  // The distances along the plane at which the line bends, in units of the source.
  get bends() {
    let distance = 0;
    const at = this.places.slice(1).map(({ source: [x, y] }, i) => {
      const [fromX, fromY] = this.places[i].source;
      distance += Math.hypot(x - fromX, y - fromY);
      return distance;
    });
    return at.slice(0, -1);
  }

  write() {
    const ways = this.places.slice(1).map(({ source }, i) => this.way(this.places[i].source, source));
    const sum = (of) => ways.reduce((total, way) => total + of(way), 0);
    const [inPlane, , upward] = this.terrain.georeference.metres;
    // A length in space has no unit of the source if its heights have another one.
    const inSpace = inPlane === upward ? inPlane : 1;
    const texts = (of) => [lengthText(of('flat'), inPlane), lengthText(of('up'), upward), lengthText(of('direct'), inSpace)];
    const lines = ways.map((way) => [...texts((name) => way[name]), `${way.degrees.toFixed(1)}°`]);
    if (ways.length > 1) lines.push([...texts((name) => sum((way) => way[name])), 'sum']);
    byId('ruler-rows').replaceChildren(...lines.map((cells) => element('tr', {}, ...cells.map((cell) => element('td', { textContent: cell })))));
    byId('ruler-table').hidden = ways.length === 0;
    const hints = ['Click the first place.', 'Click the second place.'];
    byId('ruler-hint').textContent = hints[this.places.length] ?? 'Click on for a longer line.';
  }

  way(from, to) {
    const [east, north, up] = this.terrain.georeference.metresBetween(from, to);
    const flat = Math.hypot(east, north);
    return { flat, up, direct: Math.hypot(flat, up), degrees: (Math.atan2(up, flat) * 180) / Math.PI };
  }
}
