// A camera that looks at a point and goes round it. World: metres, x to the right, y away, z up. Screen: CSS pixels, y down.

const FIELD = Math.PI / 4; // rad that the height of the screen takes in
const LEAST = -0.1; // rad by which it looks up at least: a little from below, so that what flies low is seen before the sky
const MOST = Math.PI / 2 - 0.01; // straight down, but north stays above
const TURN = 0.006; // rad a pixel
const MARGIN = 1.06; // times as much as what is fitted takes
const CLOSEST = 0.2; // m
const NEAREST = 1000; // what is in front of the eye is this part of the distance away at least
const NOWHERE = -1e6; // pixels: beside every screen
const FARTHEST = 20; // times as far as when everything is in sight

const WINDS = ["east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east"]; // counter-clockwise from x

export class Orbit {
  constructor() {
    this.target = [0, 0, 0];
    this.distance = 10;
    this.whole = 10; // the distance at which everything is in sight
    this.azimuth = -Math.PI / 2; // rad, counter-clockwise from x, from the target to the eye: it looks north
    this.elevation = 0.6; // rad
    this.width = 1;
    this.height = 1;
  }

  // One with the values of another, which is none any more once it has gone to another thread.
  static of(values) {
    return Object.assign(new Orbit(), values, { target: [...values.target] });
  }

  get field() {
    return FIELD;
  }

  resize(width, height) {
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
  }

  // Pixels for a metre that is a metre away.
  get focus() {
    return this.height / 2 / Math.tan(FIELD / 2);
  }

  // Unit vectors of the camera: to the right, up, and into the picture.
  get axes() {
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    return { right: [-sa, ca, 0], up: [-ca * se, -sa * se, ce], into: [-ca * ce, -sa * ce, -se] };
  }

  get eye() {
    const { into } = this.axes;
    return this.target.map((value, axis) => value - this.distance * into[axis]);
  }

  // From where it looks, in words: "south, 34° up".
  get words() {
    const eighth = Math.round(this.azimuth / (Math.PI / 4));
    return `${WINDS[((eighth % 8) + 8) % 8]}, ${Math.round((this.elevation * 180) / Math.PI)}° up`;
  }

  // ---- moving

  turn(dx, dy) {
    this.azimuth -= TURN * dx;
    this.elevation = Math.min(MOST, Math.max(LEAST, this.elevation + TURN * dy));
  }

  // Move the target with the ground under a hand that goes so many pixels.
  pan(dx, dy) {
    const metres = this.distance / this.focus;
    const { right } = this.axes;
    const away = [-Math.cos(this.azimuth), -Math.sin(this.azimuth)];
    for (const axis of [0, 1]) this.target[axis] -= metres * (dx * right[axis] - dy * away[axis]);
  }

  // Come closer by a factor; what lies on the ground under the pixel (px, py) stays under it.
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const distance = Math.min(FARTHEST * this.whole, Math.max(CLOSEST, this.distance / factor));
    const under = this.under(px, py);
    const left = distance / this.distance;
    if (under) for (const axis of [0, 1]) this.target[axis] = under[axis] + left * (this.target[axis] - under[axis]);
    this.distance = distance;
  }

  // The point at the target's height under a pixel: x, y; null where there is sky.
  under(px, py) {
    const { right, up, into } = this.axes;
    const [across, down] = [(px - this.width / 2) / this.focus, (py - this.height / 2) / this.focus];
    const ray = into.map((value, axis) => value + across * right[axis] - down * up[axis]);
    const { eye } = this;
    const along = (this.target[2] - eye[2]) / ray[2];
    return along > 0 && along < 10 * this.distance ? [eye[0] + along * ray[0], eye[1] + along * ray[1]] : null;
  }

  look(x, y, z = this.target[2]) {
    this.target = [x, y, z];
  }

  // Show all of a rectangle [left, bottom, right, top] up to a height, m.
  fit([left, bottom, right, top], high) {
    this.look((left + right) / 2, (bottom + top) / 2, high / 2);
    const axes = this.axes;
    const [x, y] = [(right - left) / 2, (top - bottom) / 2];
    let most = CLOSEST;
    for (const corner of [[x, y], [x, -y], [-x, y], [-x, -y]].flatMap(([dx, dy]) => [[dx, dy, high / 2], [dx, dy, -high / 2]])) {
      const along = (axis) => corner[0] * axis[0] + corner[1] * axis[1] + corner[2] * axis[2];
      const across = (Math.abs(along(axes.right)) * 2 * this.focus) / this.width;
      const upward = (Math.abs(along(axes.up)) * 2 * this.focus) / this.height;
      most = Math.max(most, MARGIN * Math.max(across, upward) - along(axes.into));
    }
    this.distance = this.whole = most;
  }

  // ---- seeing

  // The part of a polygon that is in front of the eye, as pixels [x, y] of each corner. corners: [x, y, z] of each, m.
  outline(corners) {
    const { eye, focus } = this;
    const { right, up, into } = this.axes;
    const nearest = this.distance / NEAREST;
    const seen = corners.map((corner) => [right, up, into].map((axis) => axis.reduce((sum, part, at) => sum + part * (corner[at] - eye[at]), 0)));
    const before = seen.flatMap((corner, at) => {
      const next = seen[(at + 1) % seen.length];
      const there = corner[2] > nearest;
      const part = (nearest - corner[2]) / (next[2] - corner[2]);
      const edge = there === next[2] > nearest ? [] : [corner.map((value, axis) => value + part * (next[axis] - value))];
      return there ? [corner, ...edge] : edge;
    });
    return before.map(([x, y, depth]) => [this.width / 2 + (focus * x) / depth, this.height / 2 - (focus * y) / depth]);
  }

  // Where robots are on the screen. poses: x, y and heading of each in turn; heights: z of each, or null. seen: gets x and -y in
  // pixels, and the heading, in the same order; depths: gets how far each is into the picture, m, 0 for who is not in front.
  project(poses, heights, seen, depths) {
    const { eye, focus } = this;
    const { right, up, into } = this.axes;
    const [middle, centre] = [this.width / 2, this.height / 2];
    for (let i = 0; i < depths.length; i += 1) {
      const [x, y, z] = [poses[3 * i] - eye[0], poses[3 * i + 1] - eye[1], (heights?.[i] ?? 0) - eye[2]];
      const depth = x * into[0] + y * into[1] + z * into[2];
      const there = depth > this.distance / NEAREST;
      const scale = focus / depth;
      depths[i] = there ? depth : 0;
      seen[3 * i] = there ? middle + scale * (x * right[0] + y * right[1]) : NOWHERE;
      seen[3 * i + 1] = there ? scale * (x * up[0] + y * up[1] + z * up[2]) - centre : NOWHERE;
      seen[3 * i + 2] = poses[3 * i + 2];
    }
  }

  // Half of each robot's length as it is drawn, m: its radius, but never too small to see. sizes: how many robots have which
  // radius, m, in their order; least: pixels; depths: as of `project`.
  lengths(sizes, least, depths) {
    const lengths = new Float32Array(depths.length);
    let first = 0;
    for (const [robots, radius] of sizes) lengths.fill(radius, first, (first += robots));
    return lengths.map((radius, i) => Math.max(radius, (least * depths[i]) / this.focus));
  }
}
