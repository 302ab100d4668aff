// The page of quantized.html: shows terrain/ with the QuantizedMeshPlugin of 3d-tiles-renderer, and sends the server how much of the background is
// seen, and the heights at some places.
import * as THREE from 'three';
import { TilesRenderer } from '3d-tiles-renderer';
import { QuantizedMeshPlugin } from '3d-tiles-renderer/plugins';
import { answer, errors } from './answer.js';

const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
renderer.setSize(400, 300);
document.body.append(renderer.domElement);

// Returns how many pixels have the colour of the background.
function holes() {
  const copy = Object.assign(document.createElement('canvas'), { width: 400, height: 300 });
  const pen = copy.getContext('2d');
  pen.drawImage(renderer.domElement, 0, 0, 400, 300);
  const { data } = pen.getImageData(0, 0, 400, 300);
  let count = 0;
  for (let at = 0; at < data.length; at += 4) count += data[at] > 200 && data[at + 1] < 60 && data[at + 2] > 200;
  return count;
}

// The places are those of the tileset's root: x east, y north, z up.
async function show({ places, views }) {
  const { root } = await (await fetch('/out/tileset.json')).json();
  const tiles = new TilesRenderer('/out/terrain/layer.json');
  tiles.registerPlugin(new QuantizedMeshPlugin({ skirtLength: 1000 }));
  const failures = [];
  tiles.addEventListener('load-error', ({ error }) => failures.push(String(error)));
  // The origin and the axes of the tileset are those of the scene, without its scale.
  const frame = new THREE.Group();
  frame.matrixAutoUpdate = false;
  const toEarth = new THREE.Matrix4().fromArray(root.transform);
  const [origin, turn, scale] = [new THREE.Vector3(), new THREE.Quaternion(), new THREE.Vector3()];
  toEarth.decompose(origin, turn, scale);
  frame.matrix.compose(origin, turn, new THREE.Vector3(1, 1, 1)).invert();
  const inScene = places.map((place) => new THREE.Vector3(...place).applyMatrix4(toEarth).applyMatrix4(frame.matrix));
  frame.add(tiles.group);
  const scene = new THREE.Scene();
  scene.background = new THREE.Color(1, 0, 1);
  const sun = new THREE.DirectionalLight(0xffffff, 2.5);
  sun.position.set(0.6, 0.3, 0.5);
  scene.add(new THREE.AmbientLight(0xffffff, 0.6), sun, frame);
  const camera = new THREE.PerspectiveCamera(45, 4 / 3, 1, 1e6);
  camera.up.set(0, 0, 1);
  tiles.setCamera(camera);
  const middle = inScene[0];
  // Shows the terrain from a direction, in all tiles that are needed for an error of so many pixels.
  async function shown([heading, pitch, range], errorTarget) {
    const [around, tilt] = [heading, pitch].map(THREE.MathUtils.degToRad);
    const back = new THREE.Vector3(-Math.sin(around) * Math.cos(tilt), -Math.cos(around) * Math.cos(tilt), -Math.sin(tilt));
    camera.position.copy(middle).addScaledVector(back, range);
    camera.lookAt(middle);
    camera.updateMatrixWorld();
    tiles.errorTarget = errorTarget;
    for (let calm = 0; calm < 10;) {
      tiles.setResolutionFromRenderer(camera, renderer);
      scene.updateMatrixWorld(true);
      tiles.update();
      await pause(20);
      const { downloading = 0, parsing = 0, queued = 0 } = tiles.stats;
      calm = tiles.visibleTiles.size > 0 && downloading + parsing + queued === 0 ? calm + 1 : 0;
      if (failures.length > 0) throw new Error(failures.join('; '));
    }
    renderer.render(scene, camera);
  }

  const background = [];
  for (const view of views) {
    await shown(view, 2);
    background.push(holes());
  }
  const picture = renderer.domElement.toDataURL('image/png');
  // From above, the finest tiles everywhere.
  await shown([0, -80, 3000], 0.001);
  const off = inScene.map(({ x, y, z }) => {
    const ray = new THREE.Raycaster(new THREE.Vector3(x, y, 1e4), new THREE.Vector3(0, 0, -1));
    const hit = ray.intersectObject(tiles.group, true)[0];
    return hit ? hit.point.z - z : null;
  });
  return { background, off, complaints: errors, projection: tiles.getPluginByName('QUANTIZED_MESH_PLUGIN').layer.projection, picture };
}

await answer(show);
