// Images of a map service, draped over a terrain that is on the globe. Nothing is asked for until the user, or a link, names a template.
import { ImageOverlayPlugin, XYZTilesOverlay } from '3d-tiles-renderer/plugins';

// Pixels of the image on a tile of the terrain, which has some 50,000 points.
const PIXELS = 1024;
const FINEST_LEVEL = 22;

// An answer that is no image, because the service has none at this place or level.
class NoImage extends Error {}

// Returns the quarter of an image, which has its lowest line first, that a tile one level finer covers.
async function quarter({ image }, x, y, isNorthFirst) {
  const [width, height] = [image.width / 2, image.height / 2];
  const isNorth = (y % 2 === 0) === isNorthFirst;
  const options = { resizeWidth: image.width, resizeHeight: image.height };
  return createImageBitmap(image, (x % 2) * width, isNorth ? height : 0, width, height, options);
}

// Services end at some level. Below it, parts of the finest image that there is are shown.
function takeCoarserImages(source) {
  const ended = new Set();
  const found = new Set();
  const request = async (x, y, level, signal) => {
    const answer = await source.fetchData(source.getUrl(x, y, level), { ...source.fetchOptions, signal });
    if (answer.status >= 400 && answer.status < 500) throw new NoImage(`${answer.status} ${answer.statusText}`);
    if (!answer.ok) throw new Error(`${answer.status} ${answer.statusText}`);
    return source.processBufferToTexture(await answer.arrayBuffer());
  };
  const load = async (x, y, level, signal) => {
    try {
      if (ended.has(level)) throw new NoImage('no image');
      const texture = await request(x, y, level, signal);
      found.add(level);
      return texture;
    } catch (error) {
      if (!(error instanceof NoImage) || level === 0) throw error;
      if (!found.has(level)) ended.add(level);
      const coarser = await load(x >> 1, y >> 1, level - 1, signal);
      const part = await quarter(coarser, x, y, source.tiling.flipY);
      coarser.image.close();
      coarser.image = part;
      return coarser;
    }
  };
  source.fetchItem = ([x, y, level], signal) => load(x, y, level, signal);
}

export class Images {
  // `dressing` knows the meshes. `failed` is called with what went wrong.
  constructor(tiles, dressing, failed) {
    Object.assign(this, { tiles, dressing, template: null });
    // Split tiles would have vertices that are no points.
    this.plugin = new ImageOverlayPlugin({ resolution: PIXELS, enableTileSplitting: false });
    tiles.registerPlugin(this.plugin);
    tiles.addEventListener('load-error', ({ overlay, error }) => { if (overlay && overlay === this.overlay) failed(error); });
  }

  get isLoading() {
    const { overlay, plugin } = this;
    return Boolean(overlay) && (!overlay.isReady || overlay.regionImageSource.active > 0 || Boolean(plugin.processQueue?.running));
  }

  // Shows the images of a template, or none.
  async show(template) {
    this.template = template;
    if (this.overlay) this.dressing.withoutEdges(() => this.plugin.deleteOverlay(this.overlay));
    this.overlay = null;
    if (!template) return;
    const overlay = new XYZTilesOverlay({ url: template, levels: FINEST_LEVEL });
    takeCoarserImages(overlay.imageSource);
    this.overlay = overlay;
    await overlay.init();
    overlay.setResolution(PIXELS);
    if (this.overlay === overlay) this.dressing.withoutEdges(() => this.plugin.addOverlay(overlay));
  }
}
