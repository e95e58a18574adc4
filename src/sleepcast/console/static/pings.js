// Pings: round each robot that has just pinged a ring that widens and fades, in the colour of its caste and with the
// caste's number beside it. Who has asked for less motion sees none.

import { inkOf, lookOfGroup } from "./shapes.js";
import { font } from "./type.js";

const LASTS = 800; // ms that a ring is seen
const AGAIN = 400; // ms for which a robot that goes on pinging keeps its ring
const MAX = 400; // rings at one time; more would only be a fog
const MAX_NUMBERS = 60; // rings with a number
const GROWS = 26; // pixels

export class Pings {
  constructor() {
    this.rings = new Map(); // by robot: {caste, born}
    this.still = window.matchMedia("(prefers-reduced-motion: reduce)");
  }

  // Begin a ring for each robot that pings in this frame.
  take(frame, now) {
    if (!frame.pings || this.still.matches) return;
    frame.pings.forEach((code, robot) => {
      if (code === 0) return;
      const ring = this.rings.get(robot);
      if (ring ? now - ring.born > AGAIN : this.rings.size < MAX) this.rings.set(robot, { caste: code - 1, born: now });
    });
  }

  // Draw the rings round the robots where they are now; whether there are any. sizes: of each robot, in pixels.
  draw(pen, view, frame, sizes, colours, now) {
    pen.lineWidth = 1.6;
    for (const [robot, { caste, born }] of this.rings) {
      const age = (now - born) / LASTS;
      if (age >= 1 || robot >= frame.count) {
        this.rings.delete(robot);
        continue;
      }
      const x = view.toScreenX(frame.poses[3 * robot]);
      const y = view.toScreenY(frame.poses[3 * robot + 1]);
      if (x < -GROWS || y < -GROWS || x > view.width + GROWS || y > view.height + GROWS) continue;
      const radius = sizes(robot) + 3 + GROWS * Math.sqrt(Math.max(0, age));
      pen.globalAlpha = 1 - age;
      pen.strokeStyle = colours.robots[inkOf(lookOfGroup(caste + 1))];
      pen.beginPath();
      pen.arc(x, y, radius, 0, 2 * Math.PI);
      pen.stroke();
      if (this.rings.size <= MAX_NUMBERS) this.number(pen, x + 0.72 * radius, y - 0.72 * radius, caste);
    }
    pen.globalAlpha = 1;
    return this.rings.size > 0;
  }

  number(pen, x, y, caste) {
    pen.fillStyle = pen.strokeStyle;
    pen.font = font(11, 600);
    pen.textBaseline = "bottom";
    pen.fillText(String(caste), x, y);
  }
}
