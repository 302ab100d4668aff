// Looking at the terrain from outside: the camera turns around a place on it.
import { MathUtils, MOUSE, TOUCH, Spherical, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const TURN = 0.06;
const ZOOM = 1.15;
const LOWEST = Math.PI / 2 - 0.02;

export class Orbit {
  constructor(camera, canvas, changed) {
    Object.assign(this, { camera, changed });
    this.controls = new OrbitControls(camera, canvas);
    Object.assign(this.controls, {
      zoomToCursor: true,
      screenSpacePanning: false,
      maxPolarAngle: LOWEST,
      minDistance: 0.5,
      mouseButtons: { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN },
      touches: { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN },
    });
    this.controls.addEventListener('change', changed);
  }

  set isOn(on) {
    this.controls.enabled = on;
  }

  get target() {
    return this.controls.target;
  }

  // Shows the whole of a terrain around the origin, from the south and above.
  showAll(radius) {
    this.controls.maxDistance = 12 * radius;
    const upright = Math.tan(MathUtils.degToRad(this.camera.fov / 2));
    const narrowest = Math.atan(upright * Math.min(1, this.camera.aspect));
    this.look(new Vector3(), new Vector3(0, 0.68, 0.73).setLength((0.88 * radius) / Math.sin(narrowest)));
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

  move(right, down) {
    const offset = this.camera.position.clone().sub(this.target);
    const ahead = offset.clone().setY(0).normalize();
    const aside = new Vector3(ahead.z, 0, -ahead.x);
    const step = 0.06 * offset.length();
    this.look(this.target.clone().addScaledVector(aside, right * step).addScaledVector(ahead, down * step), offset);
  }

  zoom(factor) {
    const offset = this.camera.position.clone().sub(this.target);
    const distance = Math.min(Math.max(offset.length() * factor, this.controls.minDistance), this.controls.maxDistance);
    this.look(this.target.clone(), offset.setLength(distance));
  }
}
