// The page: opens the terrain, draws it when something has changed, and joins the panel, the mouse and the keys to it.
import { CanvasTexture, PerspectiveCamera, Scene, Sprite, SpriteMaterial, Vector3, WebGLRenderer } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { byId, count } from './dom.js';
import { Dressing } from './dressing.js';
import { showLegend } from './legend.js';
import { OneFileTerrain } from './one_file_terrain.js';
import { Orbit } from './orbit.js';
import { Panel } from './panel.js';
import { Picker } from './picking.js';
import { Ruler } from './ruler.js';
import { MODES, Surface } from './surface.js';
import { TilesetTerrain } from './tileset_terrain.js';
import { Walk } from './walk.js';

const canvas = byId('terrain');
const page = document.documentElement;
// The greatest error on the screen in pixels, for each position of the slider.
const DETAIL_PIXELS = [64, 32, 16, 8, 4];
const CLICK_PIXELS = 6;
// More triangles make a computer without a graphics card of its own slow: the tiles become coarser then, step by step.
const MOST_TRIANGLES = 5e6;
const COARSER = 1.25;
const COARSER_MS = 250;

// Tells people, and programs that watch the page, how far it is: loading, shown or failed.
function say(state, text) {
  page.dataset.state = state;
  byId('message').textContent = text;
  byId('message').classList.toggle('failed', state === 'failed');
}

// The file to open. Who writes or serves the page puts its name into it; otherwise both are tried.
async function terrainFile() {
  const named = page.dataset.terrain;
  if (named) return named;
  const answer = await fetch('tileset.json', { method: 'HEAD' });
  return answer.ok ? 'tileset.json' : 'terrain.glb';
}

async function reportOf() {
  try {
    const answer = await fetch('report.json');
    return answer.ok ? await answer.json() : null;
  } catch {
    return null;
  }
}

function ringTexture() {
  const ring = Object.assign(document.createElement('canvas'), { width: 64, height: 64 });
  const pen = ring.getContext('2d');
  for (const [color, width] of [['#ffffff', 12], ['#ff2d95', 6]]) {
    Object.assign(pen, { strokeStyle: color, lineWidth: width });
    pen.beginPath();
    pen.arc(32, 32, 22, 0, 2 * Math.PI);
    pen.stroke();
  }
  return new CanvasTexture(ring);
}

class Viewer {
  constructor() {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(50, 1, 1, 1000);
    this.surface = new Surface();
    this.dressing = new Dressing(this.surface);
    this.drawn = 0;
    this.waiting = [];
    this.mode = 'points';
    this.changed = this.changed.bind(this);
    this.orbit = new Orbit(this.camera, canvas, this.changed);
    this.walk = new Walk(this.camera, canvas, (place) => this.picker?.hitBelow(place)?.point.y ?? null, this.changed);
    this.mark = new Sprite(new SpriteMaterial({ map: ringTexture(), depthTest: false, sizeAttenuation: false, toneMapped: false }));
    Object.assign(this.mark, { visible: false, renderOrder: 3 });
    this.scene.add(this.mark);
  }

  async open(file) {
    const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
    const { dressing, camera, renderer, changed } = this;
    const progress = (loaded, total) => say('loading', `Loading ${file}: ${(loaded / 1e6).toFixed(0)}${total ? ` of ${(total / 1e6).toFixed(0)}` : ''} MB`);
    const Terrain = file.endsWith('.json') ? TilesetTerrain : OneFileTerrain;
    const terrain = new Terrain(new URL(file, document.baseURI).href, { loader, dressing, camera, renderer, changed, progress });
    this.fit();
    await terrain.open();
    this.terrain = terrain;
    this.scene.add(terrain.object);
    this.detail = DETAIL_PIXELS[2];
    this.picker = new Picker(terrain, camera, () => this.nextFrame());
    this.ruler = new Ruler(this.scene, terrain, changed);
    this.orbit.showAll(terrain.radius);
  }

  // Asks for a new picture.
  changed() {
    this.asked ??= requestAnimationFrame((now) => this.draw(now));
  }

  nextFrame() {
    this.changed();
    return new Promise((resolve) => this.waiting.push(resolve));
  }

  fit() {
    const { clientWidth: width, clientHeight: height } = canvas;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.updateProjectionMatrix();
    this.changed();
  }

  draw(now) {
    this.asked = null;
    const seconds = Math.min((now - this.drawn) / 1000, 0.1);
    this.drawn = now;
    if (!this.terrain) return;
    const isOnTheWay = this.walk.isOn && this.walk.update(seconds);
    this.setDepth();
    this.camera.updateMatrixWorld();
    this.terrain.update();
    if (!this.heights && !this.terrain.isLoading && this.dressing.meshes.size) this.setHeights();
    this.renderer.render(this.scene, this.camera);
    this.limit(this.renderer.info.render.triangles, now);
    this.tell();
    this.waiting.splice(0).forEach((resolve) => resolve());
    if (isOnTheWay || this.terrain.isLoading || !this.heights) this.changed();
  }

  // Sets the nearest and the farthest depth, so that single precision can tell surfaces apart between them.
  setDepth() {
    const away = this.camera.position.length();
    const focus = this.walk.isOn ? 5 : this.camera.position.distanceTo(this.orbit.target);
    this.camera.far = away + 1.2 * this.terrain.radius;
    this.camera.near = Math.max(0.02 * focus, 1e-5 * this.camera.far, 0.05);
    this.mark.scale.setScalar(0.035);
    this.camera.updateProjectionMatrix();
  }

  setHeights() {
    this.heights = this.dressing.heightRange();
    this.surface.shared.heightRange.value = this.heights;
    this.legend();
  }

  // Sets the greatest error on the screen in pixels.
  set detail(pixels) {
    Object.assign(this, { pixels, coarser: 1, limitedAt: 0 });
    this.terrain.detail = pixels;
    this.changed();
  }

  // Makes tiles coarser while there are too many triangles, and finer again once a moved camera sees few.
  limit(triangles, now) {
    const place = this.camera.position.lengthSq() + this.camera.position.x;
    const isMoved = place !== this.limitPlace;
    this.limitPlace = place;
    const before = this.coarser;
    if (triangles > MOST_TRIANGLES && now - this.limitedAt > COARSER_MS) this.coarser *= COARSER;
    else if (isMoved && triangles < MOST_TRIANGLES / 4) this.coarser = Math.max(1, this.coarser / COARSER);
    if (this.coarser === before) return;
    this.limitedAt = now;
    this.terrain.detail = this.pixels * this.coarser;
    this.changed();
  }

  set colors(mode) {
    this.mode = mode;
    this.surface.shared.mode.value = MODES.indexOf(mode);
    this.legend();
    this.changed();
  }

  legend() {
    if (this.terrain) showLegend(this.mode, this.terrain, this.heights ?? [0, 0]);
  }

  tell() {
    const { terrain } = this;
    const { triangles } = this.renderer.info.render;
    byId('shown').textContent = `${count(triangles)} triangles are drawn${this.coarser > 1 ? ', and no finer ones, to stay fast' : ''}`;
    byId('attribution').textContent = [...terrain.attributions].join(' · ');
    if (this.mode === 'levels') this.legend();
    const isEmpty = this.dressing.meshes.size === 0;
    if (isEmpty && terrain.failures && !terrain.isLoading) say('failed', 'The tiles cannot be loaded. Is the folder complete?');
    else if (terrain.isLoading || !this.heights) say('loading', 'Loading tiles…');
    else say('shown', terrain.failures ? `${terrain.failures} tiles cannot be loaded.` : '');
  }

  // Marks a place, and follows it until the exact tile tells its coordinates. A place of the ruler is followed also after the next click.
  async pick(place, panel) {
    const number = this.picks = (this.picks ?? 0) + 1;
    const isForRuler = this.ruler.isOn;
    const isLatest = () => number === this.picks;
    let end = null;
    await this.picker.follow(place, (found, isFinal) => {
      if (!found) return;
      if (end) this.ruler.correct(end, found);
      else if (isForRuler) end = this.ruler.add(found);
      if (!isLatest()) return;
      this.mark.position.copy(found.world);
      this.mark.visible = true;
      panel.showPoint(found, isFinal);
      this.changed();
    }, () => isLatest() || this.ruler.has(end));
  }

  hitAtPixel(clientX, clientY) {
    const { left, top, width, height } = canvas.getBoundingClientRect();
    return this.picker.hitAt(((clientX - left) / width) * 2 - 1, 1 - ((clientY - top) / height) * 2);
  }

  hitInMiddle() {
    return this.picker.hitAt(0, 0);
  }

  set movement(kind) {
    const walks = kind === 'walk';
    this.orbit.isOn = !walks;
    if (walks) {
      this.back = this.camera.position.clone();
      const hit = this.hitInMiddle();
      this.walk.start(this.picker.lowestAround(hit ? hit.point : new Vector3(), 20));
    } else if (this.walk.isOn) {
      this.walk.stop();
      const here = this.camera.position.clone();
      this.orbit.look(here, this.back.sub(this.orbit.target).setLength(Math.max(60, 0.1 * this.terrain.radius)));
    }
  }
}

function listen(viewer, panel) {
  let down = null;
  new ResizeObserver(() => viewer.fit()).observe(canvas);
  canvas.addEventListener('pointerdown', (event) => { down = event; });
  canvas.addEventListener('click', (event) => {
    const moved = down ? Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) : Infinity;
    down = null;
    // The second click of a double click is no place of its own.
    if (moved > CLICK_PIXELS || event.detail > 1) return;
    const hit = viewer.hitAtPixel(event.clientX, event.clientY);
    if (hit) viewer.pick(hit.point, panel);
    else panel.showNothing();
  });
  canvas.addEventListener('dblclick', (event) => {
    const hit = viewer.hitAtPixel(event.clientX, event.clientY);
    if (hit && !viewer.walk.isOn) viewer.orbit.goTo(hit.point);
  });
  const key = (event) => {
    if (viewer.walk.isOn && viewer.walk.key(event)) {
      event.preventDefault();
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.type === 'keydown' && (event.key === 'Enter' || event.key === ' ')) {
      const hit = viewer.hitInMiddle();
      if (hit) viewer.pick(hit.point, panel);
      event.preventDefault();
      return;
    }
    if (event.type === 'keydown' && event.key === 'Home') panel.showWhole();
    else if (!viewer.walk.isOn && event.type === 'keydown' && viewer.orbit.key(event)) event.preventDefault();
  };
  canvas.addEventListener('keydown', key);
  canvas.addEventListener('keyup', key);
  canvas.addEventListener('blur', () => viewer.walk.release());
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  for (const button of byId('pad').querySelectorAll('button')) {
    const press = (isDown) => (event) => {
      event.preventDefault();
      viewer.walk.pressButton(button.dataset.key, isDown);
    };
    button.addEventListener('pointerdown', press(true));
    for (const end of ['pointerup', 'pointerleave', 'pointercancel']) button.addEventListener(end, press(false));
  }
}

function explain(error) {
  if (location.protocol === 'file:') {
    return 'A page that is opened as a file may not read the files beside it.\nRun  gdt-batch view FOLDER  or put the folder on a web server.';
  }
  return `The terrain cannot be shown: ${error.message ?? error}`;
}

try {
  const viewer = new Viewer();
  const panel = new Panel(viewer, DETAIL_PIXELS);
  const [report] = await Promise.all([reportOf(), terrainFile().then((file) => viewer.open(file))]);
  listen(viewer, panel);
  panel.enable();
  panel.showReport(report);
} catch (error) {
  say('failed', explain(error));
}
