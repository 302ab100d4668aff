// The page of terrain.html: shows terrain/ on a globe with imagery, and sends the server the heights and the water mask at some places, and how much of
// the background is seen.
import { answer, complaints } from './answer.js';

const { Cartesian3, Cartographic, CesiumTerrainProvider, CesiumWidget, Color, EllipsoidTerrainProvider, HeadingPitchRange, Math: Angles, Matrix4, Rectangle, UrlTemplateImageryProvider, WebMercatorTilingScheme, sampleTerrainMostDetailed } = window.Cesium;
const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// A picture for all tiles of the imagery: green and brown squares.
function picture() {
  const canvas = Object.assign(document.createElement('canvas'), { width: 64, height: 64 });
  const pen = canvas.getContext('2d');
  for (let square = 0; square < 16; square += 1) {
    pen.fillStyle = (square + (square >> 2)) % 2 ? '#4a7a3a' : '#8a6a4a';
    pen.fillRect(16 * (square % 4), 16 * (square >> 2), 16, 16);
  }
  return canvas.toDataURL();
}

// Renders until no tile is missing.
async function settled(scene) {
  for (let calm = 0; calm < 3;) {
    scene.render();
    await pause(0);
    calm = scene.globe.tilesLoaded ? calm + 1 : 0;
  }
}

// Returns how many pixels have the colour of the background.
function holes(scene) {
  const copy = Object.assign(document.createElement('canvas'), { width: scene.canvas.width, height: scene.canvas.height });
  const pen = copy.getContext('2d');
  pen.drawImage(scene.canvas, 0, 0);
  const { data } = pen.getImageData(0, 0, copy.width, copy.height);
  let count = 0;
  for (let at = 0; at < data.length; at += 4) count += data[at] > 200 && data[at + 1] < 60 && data[at + 2] > 200;
  return count;
}

// Returns what the water mask of the finest tile has at a place.
async function maskAt(provider, place) {
  const scheme = provider.tilingScheme;
  const level = provider.availability.computeMaximumLevelAtPosition(place);
  const { x, y } = scheme.positionToTileXY(place, level);
  const { waterMask } = await provider.requestTileGeometry(x, y, level);
  if (!waterMask || waterMask.length === 1) return waterMask?.[0] ?? null;
  const side = Math.sqrt(waterMask.length);
  const { west, north, width, height } = rectangle(scheme, x, y, level);
  const cell = (along) => Math.floor(along * side);
  return waterMask[cell((north - place.latitude) / height) * side + cell((place.longitude - west) / width)];
}

function rectangle(scheme, x, y, level) {
  const { west, south, east, north } = scheme.tileXYToRectangle(x, y, level, new Rectangle());
  return { west, north, width: east - west, height: north - south };
}

async function show({ places, views }) {
  const provider = await CesiumTerrainProvider.fromUrl('/out/terrain', { requestVertexNormals: true, requestWaterMask: true });
  const widget = new CesiumWidget('scene', {
    baseLayer: false, skyBox: false, skyAtmosphere: false, useDefaultRenderLoop: false, terrainProvider: new EllipsoidTerrainProvider(),
    creditContainer: document.createElement('div'), contextOptions: { webgl: { preserveDrawingBuffer: true } },
  });
  widget.resize();
  const { scene } = widget;
  const failures = [];
  provider.errorEvent.addEventListener(({ message }) => failures.push(message));
  scene.renderError.addEventListener((_, error) => failures.push(String(error)));
  scene.terrainProvider = provider;
  scene.backgroundColor = Color.MAGENTA;
  scene.fog.enabled = false;
  Object.assign(scene.globe, { baseColor: Color.GRAY, enableLighting: false, showGroundAtmosphere: false, depthTestAgainstTerrain: true });
  // Few pixels are drawn fast without a GPU; this makes up for them, so that as many tiles are shown as in a picture of 300 rows.
  scene.globe.maximumScreenSpaceError *= scene.canvas.height / 300;
  scene.imageryLayers.addImageryProvider(new UrlTemplateImageryProvider({ url: picture(), maximumLevel: 20 }));

  const tileset = await (await fetch('/out/tileset.json')).json();
  const toEarth = Matrix4.fromArray(tileset.root.transform);
  const positions = places.map((place) => Cartographic.fromCartesian(Matrix4.multiplyByPoint(toEarth, Cartesian3.fromArray(place), new Cartesian3())));
  const truth = positions.map((position) => position.height);
  const sampled = await sampleTerrainMostDetailed(provider, positions.map((position) => position.clone()));
  const heights = sampled.map((position) => position.height);
  const off = heights.map((height, k) => height - truth[k]);
  const masks = [];
  for (const position of positions) masks.push(await maskAt(provider, position));

  const background = [];
  const middle = Cartesian3.fromRadians(positions[0].longitude, positions[0].latitude, truth[0]);
  for (const [heading, pitch, range] of views) {
    scene.camera.lookAt(middle, new HeadingPitchRange(Angles.toRadians(heading), Angles.toRadians(pitch), range));
    await settled(scene);
    background.push(holes(scene));
    if (failures.length > 0) throw new Error(failures.join('; '));
  }
  const shot = scene.canvas.toDataURL('image/png');
  // Around the globe, all tiles are there too.
  const { longitude, latitude } = positions[0];
  scene.camera.lookAtTransform(Matrix4.IDENTITY);
  scene.camera.setView({ destination: Cartesian3.fromRadians(longitude + Math.PI, -latitude, 1e6) });
  await settled(scene);
  background.push(holes(scene));
  return { off, heights, masks, background, hasWaterMask: provider.hasWaterMask, isWebMercator: provider.tilingScheme instanceof WebMercatorTilingScheme, zoom: provider.availability.computeMaximumLevelAtPosition(positions[0]), hasNormals: provider.hasVertexNormals, complaints, picture: shot };
}

await answer(show);
