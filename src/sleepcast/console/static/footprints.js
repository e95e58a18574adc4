// What cameras that look down see of the ground, as a layer of the map and of other views: a pale disc below each robot that
// has one.

import { few, MAX_SHAPES } from "./swarm.js";

const PALE = 0.14;

export class FootprintLayer {
  // menu: the element that holds the layers.
  constructor(world, menu) {
    this.world = world;
    this.menu = menu;
    this.anywhere = true; // on other views of these robots too, each a `surface` {view, frame, inMetres, addCircle}
    world.tools.push(this);
  }

  setScene({ cameras = [] }) {
    const line = this.menu.querySelector("#layer-footprints")?.closest(".layer");
    if (line) line.hidden = !cameras.length;
  }

  drawBehind(pen, surface = this.world) {
    const { scene, colours } = this.world;
    const { inMetres: frame } = surface;
    const { cameras = [], sizes } = scene;
    if (!cameras.length || frame.heights === null || !this.world.shows("footprints") || !few(surface.view, surface.frame, MAX_SHAPES)) return;
    pen.beginPath();
    let end = 0;
    sizes.forEach(([robots], kind) => {
      const begin = end;
      end += robots;
      if (cameras[kind] > 0) this.trace(pen, surface, begin, Math.min(end, frame.count), cameras[kind]);
    });
    pen.fillStyle = colours.chosen;
    pen.globalAlpha = PALE;
    pen.fill();
    pen.globalAlpha = 1;
  }

  // Add the footprints of some robots. slope: how much farther they see with each metre above the ground.
  trace(pen, surface, begin, end, slope) {
    const { relief } = this.world;
    const { heights, poses } = surface.inMetres;
    for (let i = begin; i < end; i += 1) {
      const [x, y] = [poses[3 * i], poses[3 * i + 1]];
      const above = heights[i] - (relief?.at(x, y) ?? 0);
      if (above > 0) surface.addCircle(pen, x, y, above * slope);
    }
  }
}
