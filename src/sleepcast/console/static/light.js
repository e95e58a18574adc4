// Lights on the map: of robots whose mark is set, and of one that winks.

import { MARKED } from "./frame.js";
import { MAX_SHAPES } from "./swarm.js";

const WINKS = 5000; // ms for which a robot winks
const PERIOD = 1000; // ms from one pulse to the next

export class Lights {
  constructor(world) {
    this.world = world;
    this.index = -1; // of the robot that winks
    this.until = 0;
    this.anywhere = true; // on other views of these robots too, each a `surface` {view, frame, sizes, at}
    world.tools.push(this);
  }

  // Let a robot pulse on the map.
  wink(index) {
    this.index = index;
    this.until = performance.now() + WINKS;
    this.world.repaint("robots");
  }

  draw(pen, surface = this.world) {
    const { view, frame, sizes } = surface;
    const { colours } = this.world;
    const place = (i) => [view.toScreenX(frame.poses[3 * i]), view.toScreenY(frame.poses[3 * i + 1])];
    const glow = new Path2D();
    const points = frame.count > MAX_SHAPES;
    for (let i = 0; i < frame.count; i += 1) {
      if (!(frame.flags[i] & MARKED)) continue;
      const [x, y] = place(i);
      if (x < -20 || y < -20 || x > view.width + 20 || y > view.height + 20) continue;
      if (points) glow.rect(x - 1.5, y - 1.5, 3, 3);
      else rays(glow, x, y - sizes(i) - 3);
    }
    pen.fillStyle = colours.light;
    pen.strokeStyle = colours.ink;
    pen.lineWidth = 0.8;
    pen.fill(glow);
    if (!points) pen.stroke(glow);
    const left = this.until - performance.now();
    if (left <= 0 || this.index < 0 || this.index >= frame.count) return;
    const phase = ((WINKS - left) % PERIOD) / PERIOD;
    const [x, y] = place(this.index);
    pen.strokeStyle = colours.chosen;
    pen.lineWidth = 3;
    pen.globalAlpha = 1 - phase;
    pen.beginPath();
    pen.arc(x, y, sizes(this.index) + 6 + 34 * phase, 0, 2 * Math.PI);
    pen.stroke();
    pen.globalAlpha = 1;
    this.world.repaint("robots");
  }
}

// A small star with four rays: a light, also without its colour.
function rays(path, x, y) {
  const [long, short] = [6, 1.8];
  path.moveTo(x, y - long);
  path.lineTo(x + short, y - short);
  path.lineTo(x + long, y);
  path.lineTo(x + short, y + short);
  path.lineTo(x, y + long);
  path.lineTo(x - short, y + short);
  path.lineTo(x - long, y);
  path.lineTo(x - short, y - short);
  path.closePath();
}
