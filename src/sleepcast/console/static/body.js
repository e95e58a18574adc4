// What the chosen robot senses and believes, on the map, while a layer shows it.

import { drawBelief, drawCones, drawTouches } from "./sensing.js";
import { sizesOf } from "./swarm.js";

export class BodyLayer {
  constructor(world, senses) {
    this.world = world;
    this.senses = senses;
    world.tools.push(this);
    senses.shown.push(() => world.shows("sensors") || world.shows("encoders"));
    senses.addEventListener("sensed", () => world.repaint("robots"));
    world.addEventListener("layers", () => senses.renew());
  }

  // Drawn where the robot is in this frame, though it was asked a moment ago.
  draw(pen) {
    const { world } = this;
    const { body } = this.senses;
    const { view, frame, marks, colours, scene } = world;
    if (!body || marks.chosen >= frame.count) return;
    const [x, y, heading] = frame.poses.subarray(3 * marks.chosen, 3 * marks.chosen + 3);
    const size = sizesOf(view, scene)(marks.chosen);
    if (world.shows("sensors")) {
      drawReaches(pen, view, [x, y], body.reaches, colours);
      if (body.sonars.length) drawCones(pen, view, [x, y, heading, heading], body.radius, body.sonars, body.farthest, colours.chosen, body.beam);
      if (body.touched !== null) drawTouches(pen, view, [x, y, heading], size, [body.touched], colours.place);
    }
    if (world.shows("encoders") && body.believed) {
      const [dx, dy, turn] = body.believed.map((part, axis) => part - body.pose[axis]);
      drawBelief(pen, view, [x + dx, y + dy, heading + turn], size + 3, colours.chosen);
      drawTie(pen, view, [x, y], [x + dx, y + dy], colours.chosen);
    }
  }
}

// A circle for each sense that has a range.
function drawReaches(pen, view, [x, y], reaches, colours) {
  pen.strokeStyle = colours.chosen;
  pen.lineWidth = 1;
  pen.font = "11px system-ui, sans-serif";
  pen.textBaseline = "bottom";
  pen.fillStyle = colours.quiet;
  for (const [name, reach] of reaches) {
    const [px, py, radius] = [view.toScreenX(x), view.toScreenY(y), reach * view.scale];
    pen.setLineDash([2, 5]);
    pen.beginPath();
    pen.arc(px, py, radius, 0, 2 * Math.PI);
    pen.stroke();
    pen.setLineDash([]);
    pen.fillText(name, px + 4, py - radius - 2);
  }
}

// From where a robot is to where it believes to be.
function drawTie(pen, view, [x, y], [toX, toY], colour) {
  pen.beginPath();
  pen.moveTo(view.toScreenX(x), view.toScreenY(y));
  pen.lineTo(view.toScreenX(toX), view.toScreenY(toY));
  pen.setLineDash([2, 3]);
  pen.lineWidth = 1.2;
  pen.strokeStyle = colour;
  pen.stroke();
  pen.setLineDash([]);
}
