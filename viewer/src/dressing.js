// Dresses the meshes of loaded tiles: gives them their material, shows their edges, and finds the range of their heights.
import { BufferAttribute, Mesh, Vector3 } from 'three';
import { matrixToScene } from './surface.js';

const SAMPLES_PER_MESH = 2000;

// Returns for each vertex how far the curve of the earth has moved it up, so that colours stand for heights in the source.
function liftOf({ attributes: { position } }, toScene, georeference) {
  const lifts = new Float32Array(position.count);
  const vertex = new Vector3();
  for (let i = 0; i < position.count; i += 1) {
    lifts[i] = georeference.lift(vertex.fromBufferAttribute(position, i).applyMatrix4(toScene).toArray());
  }
  return new BufferAttribute(lifts, 1);
}

export class Dressing {
  constructor(surface) {
    this.surface = surface;
    this.meshes = new Set();
    this.showsEdges = false;
  }

  // Dresses all meshes of a glTF scene. `facts` says what a click on one of them tells of its tile, and `georeference` whether the scene
  // follows the curve of the earth.
  add(scene, levelColor, facts, georeference) {
    const meshes = [];
    scene.traverse((object) => { if (object.isMesh) meshes.push(object); });
    for (const mesh of meshes) {
      const toScene = matrixToScene(mesh, scene);
      if (georeference.curvature) mesh.geometry.setAttribute('lift', liftOf(mesh.geometry, toScene, georeference));
      const plain = mesh.material;
      mesh.material = this.surface.material(mesh, toScene, levelColor);
      plain.dispose();
      Object.assign(mesh.userData, { toScene, facts });
      this.meshes.add(mesh);
      this.dressEdges(mesh);
    }
  }

  remove(scene) {
    scene.traverse((object) => this.meshes.delete(object));
  }

  set edges(isShown) {
    this.showsEdges = isShown;
    this.meshes.forEach((mesh) => this.dressEdges(mesh));
  }

  dressEdges(mesh) {
    const { edges } = mesh.userData;
    if (this.showsEdges && !edges) {
      const lines = new Mesh(mesh.geometry, this.surface.edges);
      lines.raycast = () => {};
      lines.frustumCulled = mesh.frustumCulled;
      mesh.userData.edges = lines;
      mesh.add(lines);
      lines.updateMatrixWorld();
    } else if (edges) {
      edges.visible = this.showsEdges;
    }
  }

  // Returns the heights in metres that all but one in a hundred vertices lie between: a bird or a hole must not take the whole ramp.
  heightRange() {
    const heights = [];
    const vertex = new Vector3();
    for (const { geometry, userData } of this.meshes) {
      const { position, lift } = geometry.attributes;
      const step = Math.max(1, Math.floor(position.count / SAMPLES_PER_MESH));
      for (let i = 0; i < position.count; i += step) {
        const { y } = vertex.fromBufferAttribute(position, i).applyMatrix4(userData.toScene);
        heights.push(y - (lift?.getX(i) ?? 0));
      }
    }
    heights.sort((a, b) => a - b);
    const at = (share) => heights[Math.floor(share * (heights.length - 1))] ?? 0;
    return [at(0.005), at(0.995)];
  }
}
