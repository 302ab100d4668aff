// Walking on the terrain: the eye stays at a person's height above it.
import { Vector3 } from 'three';

const EYE_METRES = 1.7;
const METRES_PER_SECOND = 4;
const FASTER = 6;
const TURN_PER_SECOND = 1.4;
const TURN_PER_PIXEL = 0.004;
const STEEPEST_LOOK = 1.4;
// The terrain may jump, from the ground onto a tree; the eye follows within about this time.
const RISE_SECONDS = 0.15;
// But not nearer to the ground than this share of its height above it.
const LEAST_SHARE = 0.5;

// What keys do: steps ahead and to the right, turns to the right and up.
const KEYS = {
  w: [1, 0, 0, 0], s: [-1, 0, 0, 0], a: [0, -1, 0, 0], d: [0, 1, 0, 0],
  ArrowUp: [1, 0, 0, 0], ArrowDown: [-1, 0, 0, 0], ArrowLeft: [0, 0, -1, 0], ArrowRight: [0, 0, 1, 0],
  PageUp: [0, 0, 0, 1], PageDown: [0, 0, 0, -1],
};

export class Walk {
  // `groundBelow` returns the height of the terrain at a place, or null beside it.
  constructor(camera, canvas, groundBelow, changed) {
    Object.assign(this, { camera, groundBelow, changed, isOn: false, heading: 0, tilt: 0, isFast: false });
    this.pressed = new Map();
    let last = null;
    canvas.addEventListener('pointerdown', (event) => { last = event; });
    canvas.addEventListener('pointermove', (event) => {
      if (!this.isOn || !last || !event.buttons) return;
      this.look((last.clientX - event.clientX) * TURN_PER_PIXEL, (event.clientY - last.clientY) * TURN_PER_PIXEL);
      last = event;
    });
    // What is released while another window has the keys is never told.
    window.addEventListener('blur', () => this.release());
    document.addEventListener('visibilitychange', () => this.release());
  }

  // Begins at `place` and looks the way that the camera looks.
  start(place) {
    const ahead = this.camera.getWorldDirection(new Vector3());
    this.heading = Math.atan2(ahead.x, -ahead.z);
    this.tilt = 0;
    this.isOn = true;
    this.camera.position.copy(place);
    this.stand(1);
    this.changed();
  }

  // Goes on from where somebody stood, who looked at `target`.
  startAt(position, target) {
    const way = target.clone().sub(position);
    this.heading = Math.atan2(way.x, -way.z);
    this.tilt = Math.atan2(way.y, Math.hypot(way.x, way.z));
    this.camera.position.copy(position);
    this.changed();
  }

  stop() {
    this.isOn = false;
    this.release();
  }

  // Takes all keys as released.
  release() {
    this.pressed.clear();
    this.isFast = false;
  }

  // Returns whether the key means something here. With a modifier, keys belong to the browser, and some systems do not tell then when one
  // is released.
  key({ key, code, shiftKey, ctrlKey, metaKey, altKey, type }) {
    this.isFast = shiftKey;
    if (ctrlKey || metaKey || altKey) {
      this.release();
      return false;
    }
    const name = key.length === 1 ? key.toLowerCase() : key;
    // Another name may come when it is released, if a modifier has changed meanwhile.
    if (type === 'keyup') return this.press(code || name, null);
    return Boolean(KEYS[name]) && this.press(code || name, KEYS[name]);
  }

  // Begins to go some way, or no longer goes it if there is none. Returns whether anything changed.
  press(id, way) {
    const was = this.pressed.get(id);
    if (way) this.pressed.set(id, way);
    else this.pressed.delete(id);
    this.changed();
    return Boolean(way ?? was);
  }

  // The same for a button that stands for a key.
  pressButton(name, isDown) {
    return this.press(`button ${name}`, isDown ? KEYS[name] : null);
  }

  get isMoving() {
    return this.isOn && this.pressed.size > 0;
  }

  look(right, up) {
    this.heading += right;
    this.tilt = Math.min(Math.max(this.tilt + up, -STEEPEST_LOOK), STEEPEST_LOOK);
    this.changed();
  }

  faceNorth() {
    this.look(-this.heading, 0);
  }

  // Goes on for some seconds. Returns whether the eye is still on its way.
  update(seconds) {
    const [ahead, right, turn, up] = [0, 1, 2, 3].map((i) => [...this.pressed.values()].reduce((sum, way) => sum + way[i], 0));
    const [sin, cos] = [Math.sin(this.heading), Math.cos(this.heading)];
    const metres = seconds * METRES_PER_SECOND * (this.isFast ? FASTER : 1);
    this.camera.position.x += (ahead * sin + right * cos) * metres;
    this.camera.position.z += (right * sin - ahead * cos) * metres;
    this.look(turn * TURN_PER_SECOND * seconds, up * TURN_PER_SECOND * seconds);
    const rest = this.stand(Math.min(1, seconds / RISE_SECONDS));
    const flat = Math.cos(this.tilt);
    const { position } = this.camera;
    this.camera.lookAt(position.x + Math.sin(this.heading) * flat, position.y + Math.sin(this.tilt), position.z - Math.cos(this.heading) * flat);
    return this.isMoving || rest > 0.01;
  }

  // Comes closer to the height of the eye by this share of the way. Returns the metres that are left.
  stand(share) {
    const ground = this.groundBelow(this.camera.position);
    if (ground === null) return 0;
    const way = ground + EYE_METRES - this.camera.position.y;
    this.camera.position.y = Math.max(this.camera.position.y + way * share, ground + LEAST_SHARE * EYE_METRES);
    return Math.abs(ground + EYE_METRES - this.camera.position.y);
  }
}
