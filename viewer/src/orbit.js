// Looking at the terrain from outside: the camera turns around a place on it.
import { MathUtils, MOUSE, TOUCH, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { fittingView } from './fit.js';

const TURN = 0.06;
const ZOOM = 1.15;
// A turn of the wheel is many events.
const CENTRE_MS = 200;
const LOWEST = Math.PI / 2 - 0.02;
// The whole terrain is seen from the south, from as low as fills the height of the window, in degrees above the horizon; or from between these, if
// the terrain is too wide for that.
const [LOWEST_VIEW, USUAL_VIEW, HIGHEST_VIEW] = [42, 57, 69];

function wholeView(corners, camera) {
  const from = (degrees) => {
    const angle = MathUtils.degToRad(degrees);
    const forward = new Vector3(0, -Math.sin(angle), -Math.cos(angle));
    return { forward, ...fittingView(corners, forward, camera) };
  };
  for (let degrees = LOWEST_VIEW; degrees <= HIGHEST_VIEW; degrees += 3) {
    const view = from(degrees);
    if (view.isHighest) return view;
  }
  return from(USUAL_VIEW);
}

export class Orbit {
  // `groundAhead` returns the place of the terrain in the middle of the picture, or null.
  constructor(camera, canvas, groundAhead, changed) {
    Object.assign(this, { camera, groundAhead, changed, centred: 0 });
    this.controls = new OrbitControls(camera, canvas);
    Object.assign(this.controls, {
      zoomToCursor: true,
      screenSpacePanning: false,
      maxPolarAngle: LOWEST,
      minDistance: 0.5,
      mouseButtons: { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN },
      touches: { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN },
    });
    this.controls.addEventListener('start', () => this.centre());
    this.controls.addEventListener('change', changed);
  }

  set isOn(on) {
    this.controls.enabled = on;
  }

  get target() {
    return this.controls.target;
  }

  // Shows the whole of a terrain, which lies within some corners around the origin, as large as the window lets it be.
  showAll(corners) {
    const { camera } = this;
    const { forward, position } = wholeView(corners, camera);
    const radius = Math.max(...corners.map((corner) => corner.length()));
    this.controls.maxDistance = Math.max(12 * radius, 2 * position.length());
    // The camera turns around the place in its middle, at the height of the origin.
    const target = position.clone().addScaledVector(forward, -position.y / forward.y);
    this.look(target, position.sub(target));
  }

  // Turns around, and comes nearer to, what is in the middle: from another place behind it, the wheel would lead through the ground.
  centre() {
    const now = performance.now();
    if (now - this.centred < CENTRE_MS) return;
    this.centred = now;
    const place = this.groundAhead();
    if (place) this.target.copy(place);
  }

  // Puts the camera at a height, above the ground, and lets it look where it looked.
  rise(height) {
    this.camera.position.y = height;
    this.controls.update();
  }

  // Looks at `target` from `offset` beside it.
  look(target, offset) {
    this.target.copy(target);
    this.camera.position.copy(target).add(offset);
    this.controls.update();
    this.changed();
  }

  // Turns around another place from now on, and comes to at most `distance` metres.
  goTo(place, distance = Infinity) {
    const offset = this.camera.position.clone().sub(this.target);
    this.look(place, offset.setLength(Math.min(offset.length(), distance)));
  }

  // Returns whether the key means something here.
  key({ key, shiftKey }) {
    const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const zooms = { '+': 1 / ZOOM, '=': 1 / ZOOM, '-': ZOOM, _: ZOOM };
    if (turns[key]) shiftKey ? this.move(...turns[key]) : this.turn(...turns[key]);
    else if (zooms[key]) this.zoom(zooms[key]);
    else return false;
    return true;
  }

  turn(right, down) {
    const offset = this.camera.position.clone().sub(this.target);
    const angles = new Spherical().setFromVector3(offset);
    angles.theta += right * TURN;
    angles.phi = Math.min(Math.max(angles.phi + down * TURN, 0.01), LOWEST);
    this.look(this.target.clone(), offset.setFromSpherical(angles));
  }

  faceNorth() {
    const { x, y, z } = this.camera.position.clone().sub(this.target);
    this.look(this.target.clone(), new Vector3(0, y, Math.hypot(x, z)));
  }

  move(right, down) {
    const offset = this.camera.position.clone().sub(this.target);
    const ahead = offset.clone().setY(0).normalize();
    const aside = new Vector3(ahead.z, 0, -ahead.x);
    const step = 0.06 * offset.length();
    this.look(this.target.clone().addScaledVector(aside, right * step).addScaledVector(ahead, down * step), offset);
  }

  zoom(factor) {
    this.centre();
    const offset = this.camera.position.clone().sub(this.target);
    const distance = Math.min(Math.max(offset.length() * factor, this.controls.minDistance), this.controls.maxDistance);
    this.look(this.target.clone(), offset.setLength(distance));
  }
}
