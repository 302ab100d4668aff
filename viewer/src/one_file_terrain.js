// A terrain in one GLB.
import { Box3, Group, Sphere, Vector3 } from 'three';
import { Georeference } from './georeference.js';
import { EXACT_COLOR } from './surface.js';

export class OneFileTerrain {
  constructor(url, { loader, dressing, progress }) {
    Object.assign(this, { url, loader, dressing, progress });
    this.object = new Group();
    this.attributions = new Set();
    this.failures = [];
    this.isLoading = false;
  }

  // Loads the file and puts the middle of the terrain at the origin.
  async open() {
    const gltf = await this.loader.loadAsync(this.url, ({ loaded, total }) => this.progress(loaded, total));
    this.georeference = new Georeference(gltf.scene.userData, this.url.split('/').pop());
    if (gltf.asset.copyright) this.attributions.add(gltf.asset.copyright);
    const box = new Box3().setFromObject(gltf.scene);
    const sphere = box.getBoundingSphere(new Sphere());
    this.radius = sphere.radius;
    this.corners = [box.min.x, box.max.x].flatMap((x) => [box.min.y, box.max.y].flatMap((y) => [box.min.z, box.max.z].map((z) => new Vector3(x, y, z))));
    this.corners.forEach((corner) => corner.sub(sphere.center));
    this.dressing.dress(gltf.scene, EXACT_COLOR, { uri: this.url.split('/').pop(), isExact: true, level: 1, error: 0 }, this.georeference);
    this.dressing.add(gltf.scene);
    this.object.position.copy(sphere.center).negate();
    this.object.add(gltf.scene);
    this.object.updateMatrixWorld(true);
  }

  get shownScenes() {
    return { key: '', scenes: [this.object] };
  }

  get shownLevels() {
    return { coarser: [], hasExact: true };
  }

  set detail(_) {}

  update() {}

  refineAlong() {
    return () => {};
  }

  place(scenePosition) {
    return new Vector3(...scenePosition).applyMatrix4(this.object.matrixWorld);
  }
}
