// How high robots fly, as a layer of the map: a disc behind each, the darker the higher (on a dark page the brighter), and the
// scale of these shades. There is none where nobody flies.

import { hide, write } from "./elements.js";
import { between } from "./field.js";
import { few, MAX_SHAPES } from "./swarm.js";
import { heightText, roundBelow } from "./view.js";

const SHADES = 12;
const UNEVEN = 0.3; // m
const WIDER = 5; // pixels by which a disc is wider than its robot

export class HeightLayer {
  // scale: the element that says what the shades mean.
  constructor(world, scale) {
    this.world = world;
    this.scale = scale;
    this.most = 0; // m: the darkest shade; it only grows, so that shades keep their meaning
    this.stamps = new Map(); // discs by shade and size
    world.tools.push(this);
  }

  drawBehind(pen) {
    const { view, frame, sizes, ratio } = this.world;
    const { heights, poses, count } = frame;
    const whole = (pixels) => Math.round(pixels * ratio) / ratio; // what lies between the screen's pixels is drawn slowly
    const shown = heights !== null && this.world.shows("height") && few(view, frame, MAX_SHAPES);
    if (shown) this.grow(heights);
    hide(this.scale, !shown || this.most === 0);
    if (this.scale.hidden) return;
    for (let i = 0; i < count; i += 1) {
      if (!(heights[i] > this.ground(poses[3 * i], poses[3 * i + 1]))) continue;
      const radius = Math.round(sizes(i)) + WIDER;
      const stamp = this.stamp(Math.ceil(SHADES * Math.min(1, heights[i] / this.most)), radius * ratio);
      const [x, y] = [view.toScreenX(poses[3 * i]), view.toScreenY(poses[3 * i + 1])];
      pen.drawImage(stamp, whole(x - radius), whole(y - radius), stamp.width / ratio, stamp.height / ratio);
    }
  }

  // How high the ground is there, and a bit more than what pages know of it less exactly than robots do.
  ground(x, y) {
    const { relief } = this.world;
    return relief?.map ? relief.at(x, y) + UNEVEN : 0;
  }

  // Let the scale end at a round number above all heights.
  grow(heights) {
    if (this.scene !== this.world.scene.title) this.most = 0;
    this.scene = this.world.scene.title;
    const top = heights.reduce((most, z) => Math.max(most, z), this.most);
    if (top <= this.most) return;
    const step = roundBelow(top) / 2;
    this.most = Math.ceil(top / step) * step;
    const { unit } = this.world.scene;
    write(this.scale.querySelector(".text"), `up to ${heightText(this.most, unit)} high`);
  }

  // The disc of a shade from 1 to SHADES. radius: in pixels of the screen.
  stamp(shade, radius) {
    const { field } = this.world.colours;
    if (this.colours !== field) this.stamps.clear();
    this.colours = field;
    const key = shade * 1000 + radius;
    if (!this.stamps.has(key)) {
      const sheet = new OffscreenCanvas(Math.ceil(2 * radius), Math.ceil(2 * radius));
      const pen = sheet.getContext("2d");
      pen.fillStyle = `rgb(${between(field, shade / SHADES).join()})`;
      pen.arc(radius, radius, radius, 0, 2 * Math.PI);
      pen.fill();
      this.stamps.set(key, sheet.transferToImageBitmap()); // a canvas is copied each time that it is drawn
    }
    return this.stamps.get(key);
  }
}
