// What the chosen robot senses and believes, on the map, while a layer shows it.

import { drawBelief, drawCones, drawTouches } from "./sensing.js";
import { sizesOf } from "./swarm.js";

export class BodyLayer {
  constructor(world, senses) {
    this.world = world;
    this.senses = senses;
    world.tools.push(this);
    senses.shown.push(() => ["sensors", "sonar", "bumper", "encoders"].some((layer) => world.shows(layer)));
    senses.addEventListener("sensed", () => world.repaint("robots"));
    world.addEventListener("layers", () => senses.renew());
  }

  shows(layer) {
    return this.world.shows("sensors") || this.world.shows(layer);
  }

  // Where the robot is in this frame, though it was asked a moment ago: {body, pose}; null while nobody knows.
  get known() {
    const { frame, marks } = this.world;
    const { body } = this.senses;
    return body && marks.chosen < frame.count ? { body, pose: frame.poses.subarray(3 * marks.chosen, 3 * marks.chosen + 3) } : null;
  }

  // What lies around the robot, behind it.
  drawBehind(pen) {
    const { known } = this;
    if (!known) return;
    const { body, pose: [x, y, heading] } = known;
    const { view, colours } = this.world;
    if (this.shows("reaches")) drawReaches(pen, view, [x, y], body.reaches, colours);
    if (!body.sonars.length || !this.shows("sonar")) return;
    const looks = heading + body.looks - body.pose[2];
    drawCones(pen, view, [x, y, heading, looks], body.radius, body.sonars, body.farthest, colours.chosen, body.beam);
  }

  draw(pen) {
    const { known, world } = this;
    if (!known) return;
    const { body, pose: [x, y, heading] } = known;
    const { view, colours, scene, marks } = world;
    const size = sizesOf(view, scene)(marks.chosen);
    if (this.shows("bumper")) drawTouches(pen, view, [x, y, heading], size, body.touched, colours.place);
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
