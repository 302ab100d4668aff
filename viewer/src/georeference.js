// The way between positions in a glTF scene and the coordinates of the source, as `scenes[0].extras` of every GLB says it.

// Returns a number as a whole number of units of its last decimal place, exactly as it is written.
function decimal(number) {
  const [digits, exponent = '0'] = String(number).toLowerCase().split('e');
  const [whole, fraction = ''] = digits.split('.');
  const places = fraction.length - Number(exponent);
  const units = BigInt(whole + fraction);
  return places >= 0 ? { units, places } : { units: units * 10n ** BigInt(-places), places: 0 };
}

// Returns `units` of the decimal place number `places` as text.
function decimalText(units, places) {
  const digits = String(units < 0n ? -units : units).padStart(places + 1, '0');
  const at = digits.length - places;
  return `${units < 0n ? '-' : ''}${digits.slice(0, at)}${places ? `.${digits.slice(at)}` : ''}`;
}

// Returns offset + step * count without rounding, as text.
export function latticeText(offset, step, count) {
  const [from, by] = [decimal(offset), decimal(step)];
  const places = Math.max(from.places, by.places);
  const scaled = ({ units, places: own }) => units * 10n ** BigInt(places - own);
  return decimalText(scaled(from) + scaled(by) * BigInt(count), places);
}

// The displacement, in metres east, north and up, by which the scene of a wide terrain follows the curve of the earth.
class Curvature {
  constructor({ centre, half, degree, coefficients }) {
    Object.assign(this, { centre, half, degree, terms: Float64Array.from(coefficients.flat()) });
  }

  // Returns the displacement along one axis at a lattice place, whole or not. Pages ask for that of every vertex.
  along(axis, place) {
    const { degree, terms } = this;
    const u = this.share(0, place);
    const v = this.share(1, place);
    const w = this.share(2, place);
    let sum = 0;
    // From the last term back, as one multiplies polynomials out.
    let at = terms.length + axis;
    for (let i = degree; i >= 0; i -= 1) {
      let row = 0;
      for (let j = degree - i; j >= 0; j -= 1) {
        at -= 6;
        row = row * v + terms[at] + w * terms[at + 3];
      }
      sum = sum * u + row;
    }
    return sum / 1024;
  }

  share(axis, place) {
    return Math.min(Math.max((place[axis] - this.centre[axis]) / this.half[axis], -1), 1);
  }
}

export class Georeference {
  // `extras` are those of a GLB or of `asset` in tileset.json; `file` is the name of that file.
  constructor(extras, file) {
    const { offset, resolution, resolution_z: up } = extras ?? {};
    if (!Array.isArray(offset) || !(resolution > 0) || !(up > 0)) {
      throw new Error(`${file} does not say where it lies in the source (extras), as every terrain of gdt-batch does.`);
    }
    this.offset = extras.offset;
    this.steps = [extras.resolution, extras.resolution, extras.resolution_z];
    this.metres = [extras.metres_per_unit, extras.metres_per_unit, extras.metres_per_unit_z];
    this.curvature = extras.curvature ? new Curvature(extras.curvature) : null;
    this.crs = /"([^"]*)"/.exec(extras.crs ?? '')?.[1] ?? null;
  }

  // Returns the lattice place, whole or not, of metres east, north and up.
  lattice(flat) {
    return flat.map((metres, axis) => metres / (this.steps[axis] * this.metres[axis]));
  }

  // Returns by how many metres east, north and up the scene moves a place of the plane, also in metres.
  displacement(flat) {
    if (!this.curvature) return [0, 0, 0];
    const place = this.lattice(flat);
    return [0, 1, 2].map((axis) => this.curvature.along(axis, place));
  }

  // Returns the metres east, north and up on the plane of the source for a scene position, which may follow the curve of the earth.
  flat([gx, gy, gz]) {
    const moved = [gx, -gz, gy];
    if (!this.curvature) return moved;
    // The displacement changes so slowly that each round brings many more digits.
    let flat = moved;
    for (let round = 0; round < 12; round += 1) {
      const displacement = this.displacement(flat);
      flat = moved.map((metres, axis) => metres - displacement[axis]);
    }
    return flat;
  }

  // Returns nearly how far above its place on the plane a scene position lies, in metres: good enough for colours.
  lift([gx, gy, gz]) {
    return this.curvature ? this.curvature.along(2, this.lattice([gx, -gz, gy])) : 0;
  }

  // Returns the source coordinates of a scene position in metres.
  source(position) {
    return this.flat(position).map((metres, axis) => this.offset[axis] + metres / this.metres[axis]);
  }

  // Returns the steps of the lattice that a vertex at a scene position lies at.
  step(position) {
    return this.lattice(this.flat(position)).map(Math.round);
  }

  // Returns the scene position in metres of source coordinates.
  scene(source) {
    const flat = source.map((value, axis) => (value - this.offset[axis]) * this.metres[axis]);
    const displacement = this.displacement(flat);
    const [x, y, z] = flat.map((metres, axis) => metres + displacement[axis]);
    return [x, z, -y];
  }

  // Returns the source coordinates of a vertex as texts, exactly: its scene position leads to whole steps of the lattice.
  exactSource(position) {
    return this.flat(position).map((metres, axis) => {
      const count = Math.round(metres / (this.steps[axis] * this.metres[axis]));
      return latticeText(this.offset[axis], this.steps[axis], count);
    });
  }

  // Returns source coordinates as texts with the decimals of the lattice.
  roundedSource(source) {
    return source.map((value, axis) => value.toFixed(this.places(axis)));
  }

  places(axis) {
    return Math.min(Math.max(decimal(this.steps[axis]).places, decimal(this.offset[axis]).places), 9);
  }

  // Returns metres in x, y and z between two places in the source.
  metresBetween(from, to) {
    return to.map((value, axis) => (value - from[axis]) * this.metres[axis]);
  }
}
