// The panel beside the terrain.
import { byId, rows } from './dom.js';
import { pointFacts } from './legend.js';
import { describeReport } from './report.js';

const KEYS = {
  orbit: 'Drag: turn. Right button or two fingers: move. Wheel: nearer. Double click: turn around that place.\n'
    + 'Keys on the picture: arrows turn, with Shift move, + and − come nearer, Enter takes the point in the middle, Home shows all.',
  walk: 'Drag: look around. Keys on the picture: arrows or W A S D walk, with Shift faster, Page Up and Down look up and down.',
};

export class Panel {
  constructor(viewer, detailPixels) {
    this.viewer = viewer;
    this.tabs = [...byId('tabs').children];
    this.setUpTabs();
    this.setUpView(detailPixels);
    this.setUpPoint();
    byId('keys').textContent = KEYS.orbit;
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
    onChange('shaded', ({ checked }) => { viewer.surface.shared.shaded.value = checked; viewer.changed(); });
    onChange('edges', ({ checked }) => { viewer.dressing.edges = checked; viewer.changed(); });
    byId('detail').addEventListener('input', ({ target }) => { viewer.detail = detailPixels[target.value]; });
    for (const input of document.getElementsByName('move')) input.addEventListener('change', () => this.move(input.value));
    byId('whole').addEventListener('click', () => this.showWhole());
  }

  move(kind) {
    this.viewer.movement = kind;
    byId('pad').hidden = kind !== 'walk';
    byId('keys').textContent = KEYS[kind];
    document.querySelector(`input[name="move"][value="${kind}"]`).checked = true;
    if (kind === 'walk') byId('terrain').focus();
  }

  showWhole() {
    this.move('orbit');
    this.viewer.orbit.showAll(this.viewer.terrain.radius);
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
    viewer.orbit.goTo(hit.point, Math.max(20, 0.02 * viewer.terrain.radius));
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
