// The page: opens the terrain, draws it when something has changed, and joins the panel, the mouse and the keys to it.
// First, so that the policy holds for all that follows.
import { absoluteTemplate, isTemplate, mayAsk, usualImages } from './hosts.js';
import { CanvasTexture, PerspectiveCamera, Scene, Sprite, SpriteMaterial, Vector3, WebGLRenderer } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { byId, count, save } from './dom.js';
import { Dressing } from './dressing.js';
import { ExaggeratedView, LEAST, MOST, usualExaggeration } from './exaggeration.js';
import { legendOf, showLegend } from './legend.js';
import { Link, readNumbers, writeNumbers } from './link.js';
import { OneFileTerrain } from './one_file_terrain.js';
import { Orbit } from './orbit.js';
import { Panel } from './panel.js';
import { Picker } from './picking.js';
import { pictureOf } from './picture.js';
import { describeColors } from './point_colors.js';
import { ProfileChart, profileAlong } from './profile.js';
import { Ruler } from './ruler.js';
import { scaleBar, showScale } from './scale.js';
import { MODES, Surface, sunDirection } from './surface.js';
import { TilesetTerrain } from './tileset_terrain.js';
import { Walk } from './walk.js';
import { Water } from './water.js';

const canvas = byId('terrain');
const page = document.documentElement;
// The greatest error on the screen in pixels, for each position of the slider.
const DETAIL_PIXELS = [32, 16, 8, 4, 2];
// Phones have less memory, and finer screens than eyes.
const USUAL_DETAIL = matchMedia('(pointer: coarse)').matches ? 2 : 3;
const CLICK_PIXELS = 6;
// More triangles make a computer without a graphics card of its own slow: the tiles become coarser then, step by step.
const MOST_TRIANGLES = 5e6;
const COARSER = 1.25;
const COARSER_MS = 250;
// Degrees from north to the east, and above the horizon: as on maps.
const USUAL_SUN = [315, 45];
const LEAST_METRES_ABOVE = 0.5;

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

function failureText(failures) {
  if (failures.length === 0) return '';
  const [{ name, status }] = failures;
  const tile = status ? `${name} (error ${status})` : name;
  return failures.length === 1
    ? `${tile} cannot be loaded. Other tiles stand in for it.`
    : `${failures.length} tiles cannot be loaded, such as ${tile}. Others stand in for them.`;
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
    this.plain = new PerspectiveCamera(50, 1, 1, 1000);
    this.view = new ExaggeratedView(this.plain);
    this.camera = this.view.camera;
    this.surface = new Surface();
    this.dressing = new Dressing(this.surface);
    this.drawn = 0;
    this.waiting = [];
    this.mode = 'points';
    this.sun = USUAL_SUN;
    this.usual = 1;
    this.relief = 1;
    this.template = null;
    this.imagesError = '';
    this.changed = this.changed.bind(this);
    this.link = new Link(() => this.shown(), (values) => this.show(values));
    this.orbit = new Orbit(this.plain, canvas, () => this.groundAhead(), this.changed);
    this.walk = new Walk(this.plain, canvas, (place) => this.groundBelow(place), this.changed);
    this.mark = new Sprite(new SpriteMaterial({ map: ringTexture(), depthTest: false, sizeAttenuation: false, toneMapped: false }));
    Object.assign(this.mark, { visible: false, renderOrder: 3 });
    this.scene.add(this.mark);
  }

  // Opens a terrain, whose report is there or null.
  async open(file, report) {
    const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
    const { dressing, camera, renderer, changed } = this;
    const progress = (loaded, total) => say('loading', `Loading ${file}: ${(loaded / 1e6).toFixed(0)}${total ? ` of ${(total / 1e6).toFixed(0)}` : ''} MB`);
    const Terrain = file.endsWith('.json') ? TilesetTerrain : OneFileTerrain;
    const imagesFailed = (error) => this.imagesFailed(error);
    const terrain = new Terrain(new URL(file, document.baseURI).href, { loader, dressing, camera, renderer, changed, progress, imagesFailed });
    this.fit();
    dressing.water = await Water.load(report);
    await terrain.open();
    this.terrain = terrain;
    this.scene.add(terrain.object);
    this.detail = DETAIL_PIXELS[USUAL_DETAIL];
    this.picker = new Picker(terrain, camera, () => this.nextFrame());
    this.ruler = new Ruler(this.scene, terrain, changed);
    this.profile = new ProfileChart(terrain.georeference, save);
    this.showAll();
  }

  showAll() {
    this.orbit.showAll(this.terrain.corners.map((corner) => this.view.stretched(corner)));
    this.whole = this.plain.position.clone();
  }

  get isWhole() {
    return !this.walk.isOn && Boolean(this.whole?.equals(this.plain.position));
  }

  // Asks for a new picture.
  changed() {
    this.link.changed();
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
    this.surface.focalPixels.value = height / (2 * Math.tan((this.plain.fov * Math.PI) / 360));
    this.plain.aspect = width / Math.max(height, 1);
    this.plain.updateProjectionMatrix();
    if (this.terrain && this.isWhole) this.showAll();
    this.changed();
  }

  draw(now) {
    this.asked = null;
    const seconds = Math.min((now - this.drawn) / 1000, 0.1);
    this.drawn = now;
    if (!this.terrain) return;
    const isOnTheWay = this.walk.isOn && this.walk.update(seconds);
    this.setDepth();
    if (!this.walk.isOn) this.stayAbove();
    this.view.update();
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
    const { plain, orbit, view, terrain } = this;
    const focus = this.walk.isOn ? 5 : plain.position.distanceTo(orbit.target);
    const radius = Math.max(...terrain.corners.map((corner) => view.stretched(corner).length()));
    plain.far = plain.position.length() + 1.2 * radius;
    plain.near = Math.max(0.02 * focus, 1e-5 * plain.far, 0.05);
    this.mark.scale.setScalar(0.035);
    plain.updateProjectionMatrix();
  }

  // Returns the height of the terrain at a place of the stretched scene, or null beside it.
  groundBelow(place) {
    const hit = this.picker?.hitBelow(place);
    return hit ? this.view.stretched(hit.point).y : null;
  }

  groundAhead() {
    this.view.update();
    const hit = this.picker && this.hitInMiddle();
    return hit ? this.view.stretched(hit.point) : null;
  }

  // Neither the wheel nor a turn takes the camera through the ground.
  stayAbove() {
    const { position, near } = this.plain;
    const above = Math.max(Math.min(LEAST_METRES_ABOVE, 0.01 * this.terrain.radius), 1.5 * near);
    const top = Math.max(...this.terrain.corners.map((corner) => this.view.stretched(corner).y));
    if (position.y > top + above) return;
    const ground = this.groundBelow(position);
    if (ground !== null && position.y < ground + above) this.orbit.rise(ground + above);
  }

  // Takes what the coarsest tiles tell for all.
  setHeights() {
    const { heights, relief, samples } = this.dressing.survey();
    [this.heights, this.relief, this.pointColors] = [heights, relief, describeColors(samples)];
    this.surface.shared.heightRange.value = heights;
    const { corners } = this.terrain;
    const width = (axis) => Math.max(...corners.map((corner) => corner[axis])) - Math.min(...corners.map((corner) => corner[axis]));
    this.usual = usualExaggeration(Math.max(width('x'), width('z')), this.heights);
    this.link.open();
  }

  // Sets how many times as high as they are heights are drawn.
  set exaggeration(factor) {
    const grown = factor / this.view.factor;
    const { isWhole } = this;
    this.view.factor = factor;
    this.surface.shared.relief.value = (this.relief * factor) / this.usual;
    if (isWhole) this.showAll();
    else if (this.walk.isOn) this.plain.position.y *= grown;
    else this.orbit.look(this.orbit.target.clone().setY(this.orbit.target.y * grown), this.plain.position.clone().sub(this.orbit.target));
    this.legend();
    this.changed();
  }

  get exaggeration() {
    return this.view.factor;
  }

  // Sets where the sun is: degrees from north to the east, and above the horizon.
  set sunAt(angles) {
    this.sun = angles;
    this.surface.shared.sun.value.copy(sunDirection(...angles));
    this.changed();
  }

  set isShaded(isOn) {
    this.surface.shared.shaded.value = isOn;
    this.changed();
  }

  get isShaded() {
    return this.surface.shared.shaded.value;
  }

  set edges(areShown) {
    this.dressing.edges = areShown;
    this.changed();
  }

  // What an address has to say to show the same. What is as usual is left out.
  shown() {
    if (!this.walk.isOn) this.stayAbove();
    const { mode, sun, exaggeration, template } = this;
    const values = {
      view: this.isWhole ? null : this.viewText(),
      move: this.walk.isOn ? 'walk' : null,
      colours: mode === this.usualMode ? null : mode,
      exaggeration: exaggeration === this.usual ? null : String(exaggeration),
      sun: String(sun) === String(USUAL_SUN) ? null : writeNumbers(sun, 0),
      light: this.isShaded ? null : 'off',
      edges: this.dressing.showsEdges ? 'on' : null,
      images: template === usualImages ? null : template ?? 'none',
    };
    return Object.fromEntries(Object.entries(values).filter(([, value]) => value));
  }

  // Shows what an address says. What it does not say becomes as usual.
  show(values) {
    const { view, move, colours, exaggeration, sun, light, edges, images = usualImages } = values;
    const factor = Number(exaggeration);
    if (isTemplate(images) && !mayAsk(images)) {
      location.reload();
      return;
    }
    if (this.walk.isOn) this.movement = 'orbit';
    this.exaggeration = factor >= LEAST && factor <= MOST ? factor : this.usual;
    this.sunAt = readNumbers(sun, 2) ?? USUAL_SUN;
    this.isShaded = light !== 'off';
    this.edges = edges === 'on';
    this.images = isTemplate(images) ? images : null;
    const isKnown = MODES.includes(colours) && (colours !== 'images' || this.template);
    this.colors = isKnown ? colours : this.usualMode;
    this.lookAgain(readNumbers(view, 6), move === 'walk');
    this.panel?.reflect();
  }

  // Images are shown where there are some.
  get usualMode() {
    return this.template ? 'images' : 'points';
  }

  viewText() {
    const { plain, walk, orbit } = this;
    const target = walk.isOn ? plain.position.clone().addScaledVector(plain.getWorldDirection(new Vector3()), 10) : orbit.target;
    return writeNumbers([...plain.position.toArray(), ...target.toArray()], this.terrain.radius < 100 ? 4 : 2);
  }

  lookAgain(numbers, walks) {
    if (!numbers) {
      this.showAll();
      return;
    }
    const [position, target] = [new Vector3(...numbers.slice(0, 3)), new Vector3(...numbers.slice(3))];
    this.orbit.look(target, position.clone().sub(target));
    if (walks) this.movement = 'walk';
    if (walks) this.walk.startAt(position, target);
  }

  // Shows the images of a template of URLs on the terrain, or none. Throws if that is none. For a host that the page may not ask yet, it starts again.
  set images(template) {
    const { images, isOnGlobe } = this.terrain;
    const wanted = template && isOnGlobe ? absoluteTemplate(template) : null;
    if (wanted === this.template) return;
    this.template = wanted;
    this.imagesError = '';
    if (wanted && !mayAsk(wanted)) {
      this.mode = 'images';
      this.link.save();
      location.reload();
      return;
    }
    images?.show(wanted);
    this.colors = wanted ? 'images' : 'points';
  }

  imagesFailed(error) {
    const host = this.template ? new URL(this.template).host : 'the server';
    this.imagesError = `Images of ${host} cannot be loaded (${error.message}): no connection, or the server sends no CORS headers.`;
    this.panel?.reflect();
  }

  // Sets the greatest error on the screen in pixels.
  set detail(pixels) {
    Object.assign(this, { pixels, coarser: 1, limitedAt: 0 });
    this.terrain.detail = pixels;
    this.changed();
  }

  // Makes tiles coarser while there are too many triangles, and finer again once a moved camera sees few.
  limit(triangles, now) {
    const place = this.plain.position.lengthSq() + this.plain.position.x;
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

  // Whether colours are not those that points were recorded with, so that water is painted.
  get showsHeights() {
    const { ramp, isPlain } = this.pointColors;
    return this.mode === 'points' && Boolean(ramp ?? isPlain) && !this.terrain.difference;
  }

  legend() {
    if (!this.heights) return;
    this.surface.shared.paintsWater.value = this.showsHeights;
    showLegend(this);
  }

  // Returns the scale bar, or null on a walk, where each place has another scale.
  get bar() {
    if (this.walk.isOn) return null;
    const distance = this.plain.position.distanceTo(this.orbit.target);
    return scaleBar(this.plain, canvas.clientHeight, distance, this.terrain.georeference.metres[0]);
  }

  // Lets the user save the view as a picture.
  async savePicture() {
    this.view.update();
    this.renderer.render(this.scene, this.camera);
    const style = getComputedStyle(page);
    const [sky, ink] = ['--sky-colors', '--text'].map((name) => style.getPropertyValue(name).trim());
    const words = byId('attribution').textContent;
    const ratio = this.renderer.getPixelRatio();
    save(await pictureOf({ canvas, ratio, sky: sky.split(/\s+/), parts: legendOf(this), bar: this.bar, words, ink }), 'terrain.png');
  }

  // Draws the heights along the ruler anew if its places or the tiles have changed.
  showProfile() {
    const { terrain, ruler } = this;
    if (terrain.isLoading) return;
    const { key, scenes } = terrain.shownScenes;
    const shown = `${ruler.version} ${ruler.places.length > 1 ? key : ''}`;
    if (shown === this.shownProfile) return;
    this.shownProfile = shown;
    const line = ruler.places.map(({ source }) => source);
    const rows = line.length > 1 ? profileAlong(line, this.dressing.meshesOf(scenes), terrain.georeference) : [];
    this.profile.show(rows, ruler.bends);
  }

  tell() {
    const { terrain } = this;
    const { triangles } = this.renderer.info.render;
    const ahead = this.plain.getWorldDirection(new Vector3());
    byId('compass').firstElementChild.style.transform = `rotate(${-Math.atan2(ahead.x, -ahead.z)}rad)`;
    byId('shown').textContent = `${count(triangles)} triangles are drawn${this.coarser > 1 ? ', and no finer ones, to stay fast' : ''}`;
    showScale(this.heights ? this.bar : null);
    this.showProfile();
    const images = this.mode === 'images' && this.template ? [`Images: ${new URL(this.template).host}`] : [];
    byId('attribution').textContent = [...terrain.attributions, ...images].join(' · ');
    if (this.mode === 'levels' || this.dressing.hasWater !== this.toldWater) this.legend();
    this.toldWater = this.dressing.hasWater;
    const isEmpty = this.dressing.meshes.size === 0;
    if (isEmpty && terrain.failures.length && !terrain.isLoading) say('failed', 'The tiles cannot be loaded. Is the folder complete?');
    else if (terrain.isLoading || !this.heights) say('loading', 'Loading tiles…');
    else say('shown', failureText(terrain.failures));
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

  // Turns around a place of the terrain from now on, at most some metres away.
  goTo(place, distance) {
    this.orbit.goTo(this.view.stretched(place), distance);
  }

  set movement(kind) {
    const walks = kind === 'walk';
    if (walks === this.walk.isOn) return;
    this.orbit.isOn = !walks;
    if (walks) {
      this.back = this.plain.position.clone().sub(this.orbit.target);
      const hit = this.hitInMiddle();
      this.walk.start(this.view.stretched(this.picker.lowestAround(hit ? hit.point : new Vector3(), 20)));
    } else {
      this.walk.stop();
      this.orbit.look(this.plain.position.clone(), this.back.setLength(Math.max(60, 0.1 * this.terrain.radius)));
    }
  }

  get movement() {
    return this.walk.isOn ? 'walk' : 'orbit';
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
    if (hit && !viewer.walk.isOn) viewer.goTo(hit.point);
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
  byId('compass').addEventListener('click', () => (viewer.walk.isOn ? viewer.walk : viewer.orbit).faceNorth());
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
  const panel = new Panel(viewer, DETAIL_PIXELS, USUAL_DETAIL);
  viewer.panel = panel;
  const [report, file] = await Promise.all([reportOf(), terrainFile()]);
  await viewer.open(file, report);
  listen(viewer, panel);
  panel.enable();
  panel.showReport(report);
} catch (error) {
  say('failed', explain(error));
}
