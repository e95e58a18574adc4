// What the chosen robot senses and believes, on the map: asked of the desk a few times a second while a layer shows it.

import { drawBelief, drawCones, drawTouches } from "./sensing.js";
import { sizesOf } from "./swarm.js";
import { Refusal } from "./wire.js";

const AGAIN = 200; // ms between an answer and the next question

export class BodyLayer {
  constructor(world, wire) {
    this.world = world;
    this.wire = wire;
    this.known = null; // {robot, body} as the desk told it last
    this.waiting = false; // for an answer
    this.next = 0;
    this.asked = null; // robot and tick of the last question
    world.tools.push(this);
    world.addEventListener("layers", () => {
      this.asked = null;
      this.ask();
    });
  }

  get wanted() {
    return this.world.shows("sensors") || this.world.shows("encoders");
  }

  // Ask again if anything may have changed since the last answer.
  async ask() {
    const { frame, marks } = this.world;
    const now = performance.now();
    if (!this.wanted || marks.chosen < 0 || !frame || this.waiting) return;
    const same = this.asked?.robot === marks.chosen && (this.asked.tick === frame.tick || now < this.next);
    if (same) return;
    this.asked = { robot: marks.chosen, tick: frame.tick };
    this.waiting = true;
    try {
      this.known = await this.wire.ask("sense", { robot: marks.chosen });
      this.world.repaint("robots");
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.known = null; // nobody knows
    } finally {
      this.waiting = false;
      this.next = performance.now() + AGAIN;
    }
  }

  // Drawn where the robot is in this frame, though it was asked a moment ago.
  draw(pen) {
    const { world, known } = this;
    const { view, frame, marks, colours, scene } = world;
    this.ask();
    if (!known || known.robot !== marks.chosen || known.robot >= frame.count) return;
    const { body } = known;
    const [x, y, heading] = frame.poses.subarray(3 * known.robot, 3 * known.robot + 3);
    const size = sizesOf(view, scene)(known.robot);
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
