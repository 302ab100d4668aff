// The panel beside the terrain.
import { byId, rows } from './dom.js';
import { pointFacts } from './legend.js';
import { describeReport } from './report.js';

// How to move, with a mouse and keys, or with fingers.
const HINTS = {
  orbit: {
    mouse: 'Drag: turn. Right button: move. Wheel: nearer. Double click: turn around that place.\n'
      + 'Keys on the picture: arrows turn, with Shift move, + and − come nearer, Enter takes the point in the middle, Home shows all.',
    touch: 'One finger turns. Two fingers move, and come nearer. A tap tells the coordinates.',
  },
  walk: {
    mouse: 'Drag: look around. Keys on the picture: arrows or W A S D walk, with Shift faster, Page Up and Down look up and down.',
    touch: 'One finger looks around. The buttons on the picture walk.',
  },
};
const hasFingers = matchMedia('(pointer: coarse)');

// Returns the name of a direction in degrees from north to the east.
const directionName = (degrees) => ['N', 'NE', 'E', 'SE', 'S', 'SW', 'W', 'NW'][Math.round(degrees / 45) % 8];

export class Panel {
  constructor(viewer, detailPixels, usualDetail) {
    this.viewer = viewer;
    this.tabs = [...byId('tabs').children];
    this.setUpTabs();
    this.setUpView(detailPixels);
    byId('detail').value = usualDetail;
    this.setUpPoint();
    hasFingers.addEventListener('change', () => this.hint());
    this.hint();
  }

  setUpTabs() {
    this.tabs.forEach((tab, number) => {
      tab.addEventListener('click', () => this.open(tab));
      tab.addEventListener('keydown', ({ key }) => {
        const step = { ArrowLeft: -1, ArrowRight: 1 }[key];
        if (!step) return;
        const next = this.tabs[(number + step + this.tabs.length) % this.tabs.length];
        this.open(next);
        next.focus();
      });
    });
    byId('fold').addEventListener('click', () => this.fold(!byId('panel').classList.contains('folded')));
  }

  fold(isFolded) {
    byId('panel').classList.toggle('folded', isFolded);
    byId('fold').setAttribute('aria-expanded', String(!isFolded));
  }

  open(tab) {
    this.fold(false);
    for (const other of this.tabs) {
      const isOpen = other === tab;
      other.setAttribute('aria-selected', String(isOpen));
      other.tabIndex = isOpen ? 0 : -1;
      byId(other.getAttribute('aria-controls')).hidden = !isOpen;
    }
  }

  setUpView(detailPixels) {
    const { viewer } = this;
    const onChange = (id, react) => byId(id).addEventListener('change', ({ target }) => react(target));
    onChange('modes', ({ value }) => { viewer.colors = value; });
    onChange('shaded', ({ checked }) => { viewer.isShaded = checked; });
    onChange('edges', ({ checked }) => { viewer.edges = checked; });
    const onInput = (id, react) => byId(id).addEventListener('input', ({ target }) => { react(Number(target.value)); this.reflect(); });
    onInput('detail', (position) => { viewer.detail = detailPixels[position]; });
    onInput('exaggeration', (factor) => { viewer.exaggeration = factor; });
    onInput('sun-azimuth', (degrees) => { viewer.sunAt = [degrees, viewer.sun[1]]; });
    onInput('sun-altitude', (degrees) => { viewer.sunAt = [viewer.sun[0], degrees]; });
    byId('images').addEventListener('submit', (event) => {
      event.preventDefault();
      this.showImages(byId('images-url').value.trim());
    });
    byId('images-off').addEventListener('click', () => this.showImages(''));
    for (const input of document.getElementsByName('move')) input.addEventListener('change', () => this.move(input.value));
    byId('whole').addEventListener('click', () => this.showWhole());
    byId('picture').addEventListener('click', () => this.savePicture());
  }

  showImages(template) {
    try {
      this.viewer.images = template || null;
    } catch (error) {
      this.viewer.imagesError = error.message;
    }
    this.reflect();
  }

  // Shows in the panel what is set.
  reflect() {
    const { viewer } = this;
    const check = (name, value) => { document.querySelector(`input[name="${name}"][value="${value}"]`).checked = true; };
    byId('mode-images').hidden = !viewer.template;
    check('mode', viewer.mode);
    check('move', viewer.movement);
    byId('shaded').checked = viewer.isShaded;
    byId('edges').checked = viewer.dressing.showsEdges;
    byId('exaggeration').value = viewer.exaggeration;
    byId('exaggeration-value').textContent = `× ${viewer.exaggeration}`;
    [byId('sun-azimuth').value, byId('sun-altitude').value] = viewer.sun;
    byId('sun-azimuth-value').textContent = directionName(viewer.sun[0]);
    byId('sun-altitude-value').textContent = `${viewer.sun[1]}°`;
    byId('images-field').hidden = !viewer.terrain?.isOnGlobe;
    if (viewer.template) byId('images-url').value = viewer.template;
    byId('images-off').hidden = !viewer.template;
    byId('images-hint').textContent = viewer.imagesError;
    byId('pad').hidden = viewer.movement !== 'walk';
    this.hint();
  }

  hint() {
    byId('keys').textContent = HINTS[this.viewer.movement][hasFingers.matches ? 'touch' : 'mouse'];
  }

  move(kind) {
    this.viewer.movement = kind;
    this.reflect();
    if (kind === 'walk') byId('terrain').focus();
  }

  showWhole() {
    this.move('orbit');
    this.viewer.showAll();
  }

  async savePicture() {
    try {
      await this.viewer.savePicture();
      byId('picture-hint').textContent = '';
    } catch (error) {
      byId('picture-hint').textContent = `The picture cannot be saved: ${error.message}`;
    }
  }

  setUpPoint() {
    const { viewer } = this;
    byId('ruler').addEventListener('change', ({ target }) => {
      byId('ruler-body').hidden = !target.checked;
      if (target.checked) viewer.ruler.start();
      else viewer.ruler.stop();
    });
    byId('ruler-undo').addEventListener('click', () => viewer.ruler.undo());
    byId('ruler-clear').addEventListener('click', () => viewer.ruler.clear());
    byId('copy').addEventListener('click', () => this.copy());
    byId('go').addEventListener('submit', (event) => {
      event.preventDefault();
      this.goTo(byId('go-to').value);
    });
  }

  async copy() {
    const button = byId('copy');
    try {
      await navigator.clipboard.writeText(this.coordinates);
      button.textContent = 'Copied';
    } catch {
      button.textContent = 'The browser does not let this page copy';
    }
    setTimeout(() => { button.textContent = 'Copy x, y, z'; }, 2000);
  }

  async goTo(text) {
    const [x, y] = text.trim().split(/[\s,;]+/).map(Number);
    const { viewer } = this;
    const { georeference } = viewer.terrain;
    if (!Number.isFinite(x) || !Number.isFinite(y)) {
      byId('go-hint').textContent = `Write two numbers in the source's coordinates, such as ${georeference.offset.slice(0, 2).join(', ')}`;
      return;
    }
    const place = viewer.picker.placeOf(x, y);
    const hit = viewer.picker.hitBelow(place);
    byId('go-hint').textContent = hit ? '' : 'There is no terrain at this place.';
    if (!hit) return;
    this.move('orbit');
    viewer.goTo(hit.point, Math.max(20, 0.02 * viewer.terrain.radius));
    await viewer.pick(hit.point, this);
  }

  // Shows what was found at a place; not final while the exact tile is still on its way.
  showPoint(found, isFinal) {
    if (!this.viewer.ruler.isOn || !byId('report').hidden || !byId('view').hidden) this.open(this.tabs[1]);
    this.coordinates = found.text.join(', ');
    byId('point-hint').textContent = this.viewer.terrain.georeference.crs ?? 'The source names no coordinate reference system.';
    byId('point-facts').replaceChildren(...rows(pointFacts(found, this.viewer.terrain.georeference, isFinal)));
    byId('point-facts').dataset.final = String(isFinal);
    [...byId('point-facts').querySelectorAll('dd')].slice(0, 3).forEach((value) => value.classList.add('coordinate'));
    byId('copy').hidden = false;
  }

  showNothing() {
    byId('point-hint').textContent = 'There is no terrain there. Click the terrain.';
  }

  // Before the terrain is there, nothing can be set.
  enable() {
    for (const fields of document.querySelectorAll('fieldset')) fields.disabled = false;
    this.reflect();
  }

  showReport(report) {
    try {
      byId('report-body').replaceChildren(...describeReport(report));
    } catch {
      byId('report-body').textContent = 'The report.json beside the terrain is not one of this version of gdt-batch.';
    }
    byId('detail-field').hidden = !this.viewer.terrain.tiles;
    if (report?.warnings?.length) this.tabs[2].textContent = `Report (${report.warnings.length})`;
  }
}
