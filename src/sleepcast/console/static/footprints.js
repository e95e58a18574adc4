// What cameras that look down see of the ground, as a layer of the map: a pale disc below each robot that has one.

import { few, MAX_SHAPES } from "./swarm.js";

const PALE = 0.14;

export class FootprintLayer {
  // menu: the element that holds the layers.
  constructor(world, menu) {
    this.world = world;
    this.menu = menu;
    world.tools.push(this);
  }

  setScene({ cameras = [] }) {
    const line = this.menu.querySelector("#layer-footprints")?.closest(".layer");
    if (line) line.hidden = !cameras.length;
  }

  drawBehind(pen) {
    const { view, frame, scene, colours } = this.world;
    const { cameras = [], sizes } = scene;
    if (!cameras.length || frame.heights === null || !this.world.shows("footprints") || !few(view, frame, MAX_SHAPES)) return;
    pen.beginPath();
    let end = 0;
    sizes.forEach(([robots], kind) => {
      const begin = end;
      end += robots;
      if (cameras[kind] > 0) this.trace(pen, begin, Math.min(end, frame.count), cameras[kind]);
    });
    pen.fillStyle = colours.chosen;
    pen.globalAlpha = PALE;
    pen.fill();
    pen.globalAlpha = 1;
  }

  // Add the footprints of some robots. slope: how much farther they see with each metre above the ground.
  trace(pen, begin, end, slope) {
    const { view, relief, frame: { heights, poses } } = this.world;
    for (let i = begin; i < end; i += 1) {
      const [x, y] = [poses[3 * i], poses[3 * i + 1]];
      const above = heights[i] - (relief?.at(x, y) ?? 0);
      if (!(above > 0)) continue;
      const [px, py, radius] = [view.toScreenX(x), view.toScreenY(y), above * slope * view.scale];
      pen.moveTo(px + radius, py);
      pen.arc(px, py, radius, 0, 2 * Math.PI);
    }
  }
}
