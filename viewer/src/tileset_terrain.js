// A terrain in 3D Tiles: loads the tiles that the view needs, and puts them into a frame whose x is east, y up and z south.
import { Box3, Matrix4, Ray, Sphere, Vector3 } from 'three';
import { TilesRenderer, WGS84_ELLIPSOID } from '3d-tiles-renderer';
import { LoadRegionPlugin, RayRegion } from '3d-tiles-renderer/plugins';
import { Georeference } from './georeference.js';
import { Images } from './images.js';
import { EXACT_COLOR, LEVEL_COLORS } from './surface.js';

const CACHE_BYTES = 700e6;
// Places farther from the origin than this are on the globe: other tilesets have their origin inside the terrain.
const LEAST_EARTH_RADIUS = 6.2e6;

// Beside a page at the root of a server, the renderer asks for two slashes. Stores of files take them for another name.
const SINGLE_SLASHES = {
  name: 'SINGLE_SLASHES',
  preprocessURL(text) {
    const url = new URL(text, document.baseURI);
    url.pathname = url.pathname.replace(/\/{2,}/g, '/');
    return url.href;
  },
};

// Returns the name of a tile as the folder of results has it.
const nameOf = (tile) => tile.content.uri.replace(/^(\.\.\/)+/, '');

const isOnGlobe = (place) => place.length() > LEAST_EARTH_RADIUS;

// Returns the frame at a place of a tileset that is Z up: its origin there, x east, y up, z south.
function localFrame(place) {
  const eastNorthUp = new Matrix4().makeTranslation(place);
  if (isOnGlobe(place)) {
    const { lat, lon, height } = WGS84_ELLIPSOID.getPositionToCartographic(place, {});
    WGS84_ELLIPSOID.getEastNorthUpFrame(lat, lon, height, eastNorthUp);
  }
  return eastNorthUp.multiply(new Matrix4().makeRotationX(Math.PI / 2));
}

export class TilesetTerrain {
  // `loader` reads GLBs, `dressing` gives meshes their look, and `changed` is called when there is something new to draw.
  constructor(url, { loader, dressing, camera, renderer, changed, imagesFailed }) {
    Object.assign(this, { camera, renderer, dressing, changed });
    this.tiles = new TilesRenderer(url);
    this.tiles.manager.addHandler(/\.glb$/i, loader);
    this.tiles.setCamera(camera);
    Object.assign(this.tiles.lruCache, { maxBytesSize: CACHE_BYTES, minBytesSize: 0.7 * CACHE_BYTES });
    this.tiles.registerPlugin(SINGLE_SLASHES);
    this.exactPlaces = new LoadRegionPlugin();
    this.tiles.registerPlugin(this.exactPlaces);
    this.object = this.tiles.group;
    this.attributions = new Set();
    this.failures = [];
    this.images = new Images(this.tiles, dressing, imagesFailed);
    // Meshes get their material before the plug-in for images sees them.
    this.tiles.registerPlugin({ name: 'DRESSING', priority: -20, processTileModel: (scene, tile) => this.dress(scene, tile) });
    this.tiles.addEventListener('load-model', ({ scene, tile }) => this.add(scene, tile));
    this.tiles.addEventListener('dispose-model', ({ scene }) => dressing.remove(scene));
    for (const event of ['needs-update', 'tile-visibility-change', 'tiles-load-end']) {
      this.tiles.addEventListener(event, changed);
    }
  }

  // Loads the tileset and puts it into its frame.
  async open() {
    await new Promise((resolve, reject) => {
      this.tiles.addEventListener('load-root-tileset', resolve);
      this.tiles.addEventListener('load-error', ({ tile, error, overlay }) => {
        if (overlay) return;
        if (tile) this.miss(tile, error);
        else reject(error);
      });
      this.tiles.update();
    });
    const { asset } = this.tiles.rootTileset;
    this.georeference = new Georeference(asset?.extras, 'tileset.json');
    this.difference = asset?.extras?.difference;
    if (asset.copyright) this.attributions.add(asset.copyright);
    const sphere = new Sphere();
    this.tiles.getBoundingSphere(sphere);
    this.radius = sphere.radius;
    this.isOnGlobe = isOnGlobe(sphere.center);
    localFrame(sphere.center).invert().decompose(this.object.position, this.object.quaternion, this.object.scale);
    this.object.updateMatrixWorld(true);
    this.corners = this.boxCorners();
  }

  // Returns the corners of the box around the terrain, in its frame.
  boxCorners() {
    const [box, toTileset] = [new Box3(), new Matrix4()];
    this.tiles.getOrientedBoundingBox(box, toTileset);
    const { min, max } = box;
    const corners = [min.x, max.x].flatMap((x) => [min.y, max.y].flatMap((y) => [min.z, max.z].map((z) => new Vector3(x, y, z))));
    return corners.map((corner) => corner.applyMatrix4(toTileset).applyMatrix4(this.object.matrixWorld));
  }

  // A tile cannot be loaded: others stand in for it. Those are the finer ones below it, which the renderer always goes on to from a tile that is no
  // finer than the one above; or else the coarser one above, which it takes for fine enough if that has no error.
  miss(tile, error) {
    this.failures.push({ name: nameOf(tile), status: /\d{3}$/.exec(error?.message)?.[0] ?? null });
    if (tile.children.length > 0) tile.geometricError = tile.parent?.geometricError ?? tile.geometricError;
    else if (tile.parent?.internal.hasRenderableContent) tile.parent.geometricError = 0;
    this.changed();
  }

  dress(scene, tile) {
    const isExact = tile.children.length === 0;
    const level = tile.internal.depthFromRenderedParent;
    const color = isExact ? EXACT_COLOR : LEVEL_COLORS[(level - 1) % LEVEL_COLORS.length];
    const error = tile.extras?.maxError ?? 0;
    const facts = { uri: nameOf(tile), isExact, level, error };
    this.dressing.dress(scene, color, facts, this.georeference);
  }

  add(scene, tile) {
    const { copyright } = tile.engineData.metadata?.asset ?? {};
    if (copyright) this.attributions.add(copyright);
    this.dressing.add(scene);
  }

  // The levels of the coarser tiles on the screen, and whether there are exact ones.
  get shownLevels() {
    const shown = [...this.tiles.visibleTiles].filter((tile) => tile.internal.hasRenderableContent);
    const coarser = shown.filter((tile) => tile.children.length > 0).map((tile) => tile.internal.depthFromRenderedParent);
    return { coarser: [...new Set(coarser)].sort((a, b) => a - b), hasExact: shown.some((tile) => tile.children.length === 0) };
  }

  // The scenes of the tiles that are shown, and what tells them apart from others.
  get shownScenes() {
    const tiles = [...this.tiles.activeTiles].filter((tile) => tile.engineData.scene);
    return { key: tiles.map(nameOf).join(), scenes: tiles.map((tile) => tile.engineData.scene) };
  }

  set detail(pixels) {
    this.tiles.errorTarget = pixels;
  }

  update() {
    this.tiles.setResolutionFromRenderer(this.camera, this.renderer);
    this.tiles.update();
  }

  get isLoading() {
    return this.tiles.isLoading || this.tiles.loadProgress < 1 || this.images.isLoading;
  }

  // Loads the exact tiles that a ray in the frame of the terrain passes, and keeps them until the function is called that this returns.
  refineAlong(ray) {
    const inTileset = new Ray().copy(ray).applyMatrix4(new Matrix4().copy(this.object.matrixWorld).invert());
    const region = new RayRegion({ ray: inTileset, errorTarget: 0 });
    this.exactPlaces.addRegion(region);
    this.changed();
    return () => this.exactPlaces.removeRegion(region);
  }

  // Returns the place of a glTF scene position in the frame of the terrain, by the transform of the tile that is shown there or above it.
  place(scenePosition) {
    const [tile] = this.tiles.activeTiles;
    const transform = tile?.engineData.scene?.matrixWorld ?? this.object.matrixWorld;
    return new Vector3(...scenePosition).applyMatrix4(transform);
  }
}
