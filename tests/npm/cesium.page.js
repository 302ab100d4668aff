// The page of cesium.html: shows the tileset in its place on the globe, coarse and fine, and sends the server what it shows.
import { answer, complaints } from './answer.js';

const { Cartesian2, Cartesian3, Cartographic, Cesium3DTileset, CesiumWidget, Color, CustomShader, DirectionalLight, HeadingPitchRange, LightingModel, Math: Angles, Matrix4, Ray } = window.Cesium;
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

function emptyScene() {
  const widget = new CesiumWidget('scene', {
    baseLayer: false, globe: false, skyBox: false, skyAtmosphere: false, useDefaultRenderLoop: false,
    msaaSamples: 1, orderIndependentTranslucency: false, creditContainer: document.createElement('div'), contextOptions: { webgl: { preserveDrawingBuffer: true } },
  });
  widget.resize();
  const { scene } = widget;
  scene.backgroundColor = Color.fromCssColorString('#8fb3d9');
  return scene;
}

// Looks from the south and from above, with the light from the south-east.
function lookAt(scene, tileset) {
  const { center, radius } = tileset.boundingSphere;
  scene.camera.lookAt(center, new HeadingPitchRange(0, Angles.toRadians(-45), radius * 2));
  const direction = Matrix4.multiplyByPointAsVector(tileset.root.computedTransform, new Cartesian3(-0.5, 0.5, -1), new Cartesian3());
  scene.light = new DirectionalLight({ direction: Cartesian3.normalize(direction, direction), intensity: 3 });
}

// Returns the height at x, y in the tileset's own frame, looking straight down. getHeight would look towards the centre of the
// earth, 0.2 degrees off the plumb line at these latitudes. On walls and tree trunks laser points lie above each other, and triangles
// rise 300 m per metre. There the two lines of sight would meet the terrain metres apart.
function heightOver(scene, tileset, [x, y]) {
  const toWorld = tileset.root.computedTransform;
  const origin = Matrix4.multiplyByPoint(toWorld, new Cartesian3(x, y, 1e5), new Cartesian3());
  const down = Matrix4.multiplyByPointAsVector(toWorld, new Cartesian3(0, 0, -1), new Cartesian3());
  const found = tileset.pick(new Ray(origin, Cartesian3.normalize(down, down)), scene.frameState, new Cartesian3());
  return found ? Matrix4.multiplyByPoint(Matrix4.inverse(toWorld, new Matrix4()), found, new Cartesian3()).z : null;
}

// Returns a screen space error in pixels at which CesiumJS shows the root alone. Above that of the tileset it would show nothing.
async function coarseError(scene, tileset) {
  const { geometricError, root } = await (await fetch('/out/tileset.json')).json();
  const { center, radius } = tileset.boundingSphere;
  const distance = Cartesian3.distance(scene.camera.positionWC, center) - radius / 2;
  return Math.sqrt(geometricError * root.geometricError) * scene.drawingBufferHeight / (distance * scene.camera.frustum.sseDenominator);
}

function facts(scene, tileset, shown, places) {
  const triangles = [...shown].reduce((sum, tile) => sum + tile.content.trianglesLength, 0);
  return { triangles, meshes: shown.size, heights: places.map((place) => heightOver(scene, tileset, place)) };
}

// Returns what the schema of the tile at the first of `pixels` says that vertices carry, and red and green of the picture at each of them
// when a shader shows the intensity as red and the class as green.
async function attributesAt(scene, tileset, pixels) {
  const schema = scene.pickMetadataSchema(new Cartesian2(...pixels[0]));
  tileset.customShader = new CustomShader({
    lightingModel: LightingModel.UNLIT,
    fragmentShaderText: `void fragmentMain(FragmentInput fsInput, inout czm_modelMaterial material) {
      material.diffuse = vec3(float(fsInput.metadata.intensity) / 65535.0, float(fsInput.metadata.classification) / 10.0, 0.0);
    }`,
  });
  for (let frame = 0; frame < 20; frame += 1) {
    scene.render();
    await pause(20);
  }
  const picture = Object.assign(document.createElement('canvas'), { width: scene.canvas.width, height: scene.canvas.height });
  const pen = picture.getContext('2d');
  pen.drawImage(scene.canvas, 0, 0);
  const shown = pixels.map(([x, y]) => [...pen.getImageData(x, y, 1, 1).data.slice(0, 2)]);
  return { schema: schema?.id, properties: Object.keys(schema?.classes.point?.properties ?? {}), shown };
}

async function show({ places, pixels }) {
  const scene = emptyScene();
  const tileset = await Cesium3DTileset.fromUrl('/out/tileset.json', {
    foveatedScreenSpaceError: false, cullRequestsWhileMoving: false, cacheBytes: 2 ** 32, enablePick: true,
  });
  const failures = [];
  tileset.tileFailed.addEventListener(({ url, message }) => failures.push(`${url}: ${message}`));
  scene.renderError.addEventListener((_, error) => failures.push(String(error)));
  scene.primitives.add(tileset);
  lookAt(scene, tileset);
  const shown = new Set();
  tileset.tileVisible.addEventListener((tile) => shown.add(tile));
  const seen = {};
  for (const [name, error] of [['coarse', await coarseError(scene, tileset)], ['fine', 1e-6]]) {
    tileset.maximumScreenSpaceError = error;
    for (let calm = 0; calm < 5;) {
      shown.clear();
      scene.render();
      await pause(20);
      calm = tileset.tilesLoaded && shown.size > 0 ? calm + 1 : 0;
      if (failures.length > 0) throw new Error(failures.join('; '));
    }
    seen[name] = facts(scene, tileset, shown, places);
  }
  const { longitude, latitude, height } = Cartographic.fromCartesian(tileset.boundingSphere.center);
  const centre = [Angles.toDegrees(longitude), Angles.toDegrees(latitude), height];
  const picture = scene.canvas.toDataURL('image/png');
  const attributes = pixels && await attributesAt(scene, tileset, pixels);
  return { ...seen, centre, picture, attributes, complaints };
}

await answer(show);
