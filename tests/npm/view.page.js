// The page of view.html: shows the single file, and the tileset coarse and fine, if they exist, and sends the server what it shows.
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { TilesRenderer } from '3d-tiles-renderer';
import { answer } from './answer.js';

const renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
renderer.setSize(400, 300);
document.body.append(renderer.domElement);
const gltf = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

function sceneWith(object, up) {
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(0x8fb3d9);
  const sun = new THREE.DirectionalLight(0xffffff, 2.5);
  sun.position.copy(up).add(new THREE.Vector3(0.6, 0.3, 0.5));
  scene.add(new THREE.AmbientLight(0xffffff, 0.6), sun, object);
  return scene;
}

// Looks from the south and from above.
function cameraOver(box, up) {
  const centre = box.getCenter(new THREE.Vector3());
  const size = box.getSize(new THREE.Vector3()).length();
  const camera = new THREE.PerspectiveCamera(45, 4 / 3, size / 1000, size * 10);
  const side = Math.abs(up.y) > 0.5 ? new THREE.Vector3(0, 0, 1) : new THREE.Vector3(0, -1, 0);
  camera.up.copy(up);
  camera.position.copy(centre).addScaledVector(up, size * 0.6).addScaledVector(side, size * 0.6);
  camera.lookAt(centre);
  camera.updateMatrixWorld();
  return camera;
}

function meshesIn(root) {
  const meshes = [];
  root.updateMatrixWorld(true);
  root.traverseVisible((object) => { if (object.isMesh) meshes.push(object); });
  return meshes;
}

function facts(root, places, toWorld, up) {
  const meshes = meshesIn(root);
  const triangles = meshes.reduce((sum, mesh) => sum + mesh.geometry.index.count / 3, 0);
  const inverse = toWorld.clone().invert();
  const box = new THREE.Box3();
  const point = new THREE.Vector3();
  for (const mesh of meshes) {
    mesh.material.side = THREE.DoubleSide;
    const position = mesh.geometry.attributes.position;
    for (let i = 0; i < position.count; i++) {
      box.expandByPoint(point.fromBufferAttribute(position, i).applyMatrix4(mesh.matrixWorld).applyMatrix4(inverse));
    }
  }
  const heights = places.map(([x, y]) => {
    const [from, to] = [1e5, -1e5].map((h) => (up === 'y' ? new THREE.Vector3(x, h, -y) : new THREE.Vector3(x, y, h)).applyMatrix4(toWorld));
    const ray = new THREE.Raycaster(from, to.sub(from).normalize());
    const hit = ray.intersectObjects(meshes, false)[0];
    return hit ? hit.point.applyMatrix4(inverse)[up] : null;
  });
  return { triangles, box: [box.min.toArray(), box.max.toArray()], heights, meshes: meshes.length };
}

const isThere = async (path) => (await fetch(path, { method: 'HEAD' })).ok;
const picture = () => renderer.domElement.toDataURL('image/png');

async function showTiles(places) {
  if (!await isThere('/out/tileset.json')) return null;
  const root = (await (await fetch('/out/tileset.json')).json()).root;
  const toWorld = new THREE.Matrix4().fromArray(root.transform ?? new THREE.Matrix4().toArray());
  const tiles = new TilesRenderer('/out/tileset.json');
  tiles.manager.addHandler(/\.(gltf|glb)$/i, gltf);
  tiles.displayActiveTiles = true;
  let loaded = false;
  tiles.addEventListener('load-root-tileset', () => { loaded = true; });
  tiles.addEventListener('load-tileset', () => { loaded = true; });
  const failures = [];
  tiles.addEventListener('load-error', (event) => failures.push(String(event.error)));
  // This undoes the tileset's transform, so that the camera is near the origin and single precision suffices.
  const frame = new THREE.Group();
  toWorld.clone().invert().decompose(frame.position, frame.quaternion, frame.scale);
  frame.matrixAutoUpdate = false;
  frame.matrix.copy(toWorld).invert();
  frame.add(tiles.group);
  const up = new THREE.Vector3(0, 0, 1);
  const scene = sceneWith(frame, up);
  const [cx, cy, cz, hx, , , , hy, , , , hz] = root.boundingVolume.box;
  const box = new THREE.Box3(new THREE.Vector3(cx - hx, cy - hy, cz - hz), new THREE.Vector3(cx + hx, cy + hy, cz + hz));
  const camera = cameraOver(box, up);
  tiles.setCamera(camera);
  tiles.setResolutionFromRenderer(camera, renderer);
  scene.updateMatrixWorld(true);
  const seen = {};
  for (const [name, target] of [['coarse', 1e9], ['fine', 1e-6]]) {
    tiles.errorTarget = target;
    for (let calm = 0; calm < 10;) {
      scene.updateMatrixWorld(true);
      tiles.update();
      await pause(20);
      const { downloading = 0, parsing = 0, queued = 0 } = tiles.stats ?? {};
      calm = loaded && downloading + parsing + queued === 0 && meshesIn(tiles.group).length > 0 ? calm + 1 : 0;
      if (failures.length > 0) throw new Error(failures.join('; '));
    }
    renderer.render(scene, camera);
    // The frame has undone the transform, so these are the tileset's own coordinates.
    seen[name] = facts(tiles.group, places, new THREE.Matrix4(), 'z');
  }
  return { ...seen, picture: picture() };
}

async function showFile(places) {
  if (!await isThere('/out/terrain.glb')) return null;
  const { scene: terrain } = await gltf.loadAsync('/out/terrain.glb');
  const up = new THREE.Vector3(0, 1, 0);
  const scene = sceneWith(terrain, up);
  renderer.render(scene, cameraOver(new THREE.Box3().setFromObject(terrain), up));
  return facts(terrain, places, new THREE.Matrix4(), 'y');
}

await answer(async ({ places }) => {
  await MeshoptDecoder.ready;
  const file = await showFile(places);
  return { file, picture: picture(), ...await showTiles(places) };
});
