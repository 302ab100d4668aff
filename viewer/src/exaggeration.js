// The view of a terrain whose heights are exaggerated. The terrain itself stays as it is, so that whatever is measured on it is true; instead
// the camera is pressed: what it sees of the true scene is what a plain camera would see of a stretched one. Controls move the plain camera.
import { Matrix4, PerspectiveCamera } from 'three';

export const [LEAST, MOST] = [1, 5];
// Terrains whose heights span less than these shares of their width begin with more than their true heights.
const FLAT = [[1 / 150, 3], [1 / 50, 2]];

// Returns what a terrain of this width and these heights in metres begins with.
export function usualExaggeration(width, [low, high]) {
  return FLAT.find(([share]) => high - low < share * width)?.[1] ?? 1;
}

export class ExaggeratedView {
  // `plain` is the camera in the stretched scene. `camera` is the one to draw with, and to pick with.
  constructor(plain) {
    this.plain = plain;
    this.camera = new PerspectiveCamera();
    this.camera.matrixAutoUpdate = false;
    // three.js would take the scale out of the matrix.
    this.camera.matrixWorldAutoUpdate = false;
    this.factor = 1;
  }

  // Follows the plain camera.
  update() {
    const { plain, camera, factor } = this;
    plain.updateMatrixWorld();
    camera.projectionMatrix.copy(plain.projectionMatrix);
    camera.projectionMatrixInverse.copy(plain.projectionMatrixInverse);
    camera.matrixWorld.makeScale(1, 1 / factor, 1).multiply(plain.matrixWorld);
    camera.matrixWorldInverse.copy(plain.matrixWorldInverse).multiply(new Matrix4().makeScale(1, factor, 1));
  }

  // Returns a place of the true scene in the stretched one.
  stretched(place) {
    return place.clone().setY(place.y * this.factor);
  }
}
