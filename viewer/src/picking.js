// From a pixel to the terrain, and from the terrain to coordinates of the source.
import { Raycaster, Vector2, Vector3 } from 'three';

const DOWN = new Vector3(0, -1, 0);
// How long nothing may load before what is shown counts as the finest there is. Between two levels, a few frames load nothing.
const QUIET_MS = 2000;

// Returns what a hit on a mesh tells: the place on the triangle, its nearest vertex with class and intensity if it carries them, and the tile.
export function describeHit({ object, face, point }, georeference) {
  const { toScene, facts } = object.userData;
  const { position, _classification: classes, _intensity: intensities } = object.geometry.attributes;
  const inScene = (vertex) => vertex.applyMatrix4(toScene).toArray();
  const place = inScene(object.worldToLocal(point.clone()));
  const corners = [face.a, face.b, face.c].map((index) => ({ index, at: inScene(new Vector3().fromBufferAttribute(position, index)) }));
  const distance = ({ at }) => Math.hypot(...at.map((value, axis) => value - place[axis]));
  const nearest = corners.reduce((best, corner) => (distance(corner) < distance(best) ? corner : best));
  const source = georeference.source(place);
  return {
    ...facts,
    world: point.clone(),
    source,
    text: georeference.roundedSource(source),
    vertex: georeference.exactSource(nearest.at),
    vertexWorld: new Vector3(...nearest.at).applyMatrix4(toScene.clone().invert()).applyMatrix4(object.matrixWorld),
    vertexMetres: distance(nearest),
    classification: classes?.getX(nearest.index),
    intensity: intensities?.getX(nearest.index),
  };
}

export class Picker {
  constructor(terrain, camera, nextFrame) {
    Object.assign(this, { terrain, camera, nextFrame });
    this.raycaster = new Raycaster();
    this.raycaster.firstHitOnly = true;
    this.release = () => {};
  }

  // Returns the first hit of the ray through a pixel, given from -1 to 1 to the right and up; null if it misses the terrain.
  hitAt(x, y) {
    this.raycaster.setFromCamera(new Vector2(x, y), this.camera);
    return this.cast();
  }

  // Returns the hit below or above a place.
  hitBelow({ x, z }) {
    this.raycaster.set(this.above(x, z), DOWN);
    return this.cast();
  }

  // Returns the lowest of some places around one: rather the ground than the top of a tree.
  lowestAround(middle, metres) {
    const steps = [-1, -0.5, 0, 0.5, 1];
    const around = steps.flatMap((x) => steps.map((z) => this.hitBelow({ x: middle.x + x * metres, z: middle.z + z * metres })));
    const places = around.filter(Boolean).map(({ point }) => point);
    return places.reduce((lowest, place) => (place.y < lowest.y ? place : lowest), places[0] ?? middle);
  }

  above(x, z) {
    return new Vector3(x, 8 * this.terrain.radius, z);
  }

  cast() {
    const hits = this.raycaster.intersectObject(this.terrain.object, true);
    return hits.reduce((first, hit) => (first && first.distance <= hit.distance ? first : hit), null);
  }

  describe(hit) {
    return describeHit(hit, this.terrain.georeference);
  }

  // Calls `show` with what is at `place`, and again with what the exact tile says, once that is loaded. The last call has `isFinal`. Ends
  // early when `isWanted` no longer holds. The exact tile stays until another place is final.
  async follow(place, show, isWanted) {
    const release = this.terrain.refineAlong({ origin: this.above(place.x, place.z), direction: DOWN });
    for (let busy = performance.now(), isFinal = false; !isFinal && isWanted();) {
      const hit = this.hitBelow(place);
      const found = hit && this.describe(hit);
      isFinal = Boolean(found?.isExact) || performance.now() - busy > QUIET_MS;
      show(found, isFinal);
      if (!isFinal) await this.nextFrame();
      if (this.terrain.isLoading) busy = performance.now();
    }
    this.release();
    this.release = release;
  }

  // Returns the place in the frame of the terrain above source coordinates x and y. Each tile may have a transform of its own, so that a
  // first guess is corrected by what lies there.
  placeOf(x, y) {
    const { georeference } = this.terrain;
    const place = this.terrain.place(georeference.scene([x, y, georeference.offset[2]]));
    for (let round = 0; round < 3; round += 1) {
      const hit = this.hitBelow(place);
      if (!hit) break;
      const { source } = this.describe(hit);
      const [east, north] = georeference.metresBetween(source, [x, y, source[2]]);
      const { toScene } = hit.object.userData;
      const toWorld = hit.object.matrixWorld.clone().multiply(toScene.clone().invert());
      place.add(new Vector3(east, 0, -north).transformDirection(toWorld).multiplyScalar(Math.hypot(east, north)));
    }
    return place;
  }
}
