// Dresses the meshes of loaded tiles: gives them their material, shows their edges, and finds the range of their heights.
import { BufferAttribute, Mesh, Vector3 } from 'three';
import { matrixToScene } from './surface.js';
import { Water } from './water.js';

const SAMPLES_PER_MESH = 2000;
// Slopes are drawn so much steeper, or flatter, that this share of the terrain has less than this slope (rise over run): hills and valleys are
// seen then. The same rule makes preview.png. The bounds keep trees from going black, and noise from looking like hills.
const [STEEP_SHARE, TARGET_SLOPE] = [0.7, 0.6];
const RELIEF_BOUNDS = [0.3, 20];
// A triangle is part of a skirt if its area in the plane is no more than this share of its area.
const SKIRT = 1e-4;

// Returns for each vertex how far the curve of the earth has moved it up, so that colours stand for heights in the source.
function liftOf({ attributes: { position } }, toScene, georeference) {
  const lifts = new Float32Array(position.count);
  const vertex = new Vector3();
  for (let i = 0; i < position.count; i += 1) {
    lifts[i] = georeference.lift(vertex.fromBufferAttribute(position, i).applyMatrix4(toScene).toArray());
  }
  return new BufferAttribute(lifts, 1);
}

// Yields some triangles of a mesh, but for the skirts of coarser tiles, which are vertical: the numbers of their corners, where those are in metres,
// and twice their areas along the axes.
function* someTriangles({ geometry: { index, attributes: { position } }, userData: { toScene } }) {
  const count = Math.floor((index ?? position).count / 3);
  const step = Math.max(1, Math.floor(count / SAMPLES_PER_MESH));
  const corners = [new Vector3(), new Vector3(), new Vector3()];
  const [ab, ac] = [new Vector3(), new Vector3()];
  for (let i = 0; i < count; i += step) {
    const numbers = corners.map((_, k) => (index ? index.getX(3 * i + k) : 3 * i + k));
    corners.forEach((corner, k) => corner.fromBufferAttribute(position, numbers[k]).applyMatrix4(toScene));
    const [a, b, c] = corners;
    const area = ab.subVectors(b, a).cross(ac.subVectors(c, a));
    if (Math.abs(area.y) > SKIRT * area.length()) yield { numbers, corners, area };
  }
}

// Returns about how far the vertices of a mesh are apart in the plane, in metres, from some of its triangles. Trees and walls must not count.
function spacingOf(mesh) {
  return Math.sqrt(quantile(Array.from(someTriangles(mesh), ({ area }) => Math.abs(area.y)), 0.5));
}

function meshesOf(scene) {
  const meshes = [];
  scene.traverse((object) => { if (object.isMesh) meshes.push(object); });
  return meshes;
}

// Returns the value that this share of the values is below.
function quantile(values, share) {
  values.sort((a, b) => a - b);
  return values[Math.floor(share * (values.length - 1))] ?? 0;
}

export class Dressing {
  constructor(surface) {
    this.surface = surface;
    this.meshes = new Set();
    // The meshes of the coarsest level that has been loaded, until they have told the heights of the whole terrain. Those of the tiles on the screen
    // would tell others each time, as they come in another order.
    this.coarsest = { level: Infinity, meshes: [] };
    this.showsEdges = false;
    this.hasWater = false;
    this.water = new Water();
  }

  // Gives all meshes of a glTF scene their material. `facts` says what a click on one of them tells of its tile, and `georeference` whether the
  // scene follows the curve of the earth.
  dress(scene, levelColor, facts, georeference) {
    for (const mesh of meshesOf(scene)) {
      const toScene = matrixToScene(mesh, scene);
      if (georeference.curvature) mesh.geometry.setAttribute('lift', liftOf(mesh.geometry, toScene, georeference));
      const water = this.water.attribute(mesh.geometry, toScene, georeference);
      if (water) mesh.geometry.setAttribute('water', water);
      this.hasWater ||= Boolean(water);
      const plain = mesh.material;
      mesh.material = this.surface.material(mesh, toScene, levelColor);
      plain.dispose();
      Object.assign(mesh.userData, { toScene, facts });
      this.noteCoarsest(mesh);
    }
  }

  noteCoarsest(mesh) {
    const { level } = mesh.userData.facts;
    if (!this.coarsest || level > this.coarsest.level) return;
    if (level < this.coarsest.level) this.coarsest = { level, meshes: [] };
    this.coarsest.meshes.push(mesh);
  }

  // Takes note of the meshes of a scene that can be shown from now on.
  add(scene) {
    for (const mesh of meshesOf(scene)) {
      this.meshes.add(mesh);
      this.dressEdges(mesh);
    }
  }

  // Returns the meshes of some scenes that can be shown.
  meshesOf(scenes) {
    return scenes.flatMap(meshesOf).filter((mesh) => this.meshes.has(mesh));
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
      const lines = new Mesh(mesh.geometry, this.surface.edges(spacingOf(mesh)));
      lines.raycast = () => {};
      lines.frustumCulled = mesh.frustumCulled;
      mesh.userData.edges = lines;
      mesh.add(lines);
      lines.updateMatrixWorld();
    } else if (edges) {
      edges.visible = this.showsEdges;
    }
  }

  // Takes the edges off while `act` looks through the meshes.
  withoutEdges(act) {
    const shown = [...this.meshes].filter(({ userData }) => userData.edges);
    shown.forEach((mesh) => mesh.remove(mesh.userData.edges));
    act();
    shown.forEach((mesh) => mesh.add(mesh.userData.edges));
  }

  // Returns what the coarsest tiles tell of the whole terrain, once: the heights in metres that all but one in a hundred vertices lie between,
  // because a bird or a hole must not take the whole ramp; how much steeper slopes are to be lit than they are; and some vertices: their heights
  // in metres, and their colours, if they have any, as three linear values.
  survey() {
    const { meshes } = this.coarsest;
    this.coarsest = null;
    const samples = meshes.flatMap(samplesOf);
    const heights = samples.map(({ height }) => height);
    return { heights: [quantile(heights, 0.005), quantile(heights, 0.995)], relief: reliefOf(meshes), samples };
  }
}

function samplesOf(mesh) {
  const { lift, color } = mesh.geometry.attributes;
  return Array.from(someTriangles(mesh), ({ numbers: [i], corners: [{ y }] }) => ({
    height: y - (lift?.getX(i) ?? 0),
    color: color && [color.getX(i), color.getY(i), color.getZ(i)],
  }));
}

function reliefOf(meshes) {
  const slopesOf = (mesh) => Array.from(someTriangles(mesh), ({ area: { x, y, z } }) => Math.hypot(x, z) / Math.abs(y));
  const slopes = meshes.flatMap(slopesOf);
  const [least, most] = RELIEF_BOUNDS;
  return Math.min(Math.max(TARGET_SLOPE / Math.max(quantile(slopes, STEEP_SHARE), 1e-6), least), most);
}
