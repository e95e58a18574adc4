// What the map shows of Nomads beside their bodies: both traces, where each believes to be, its turret, what programs have
// drawn; and a robot that is dragged elsewhere.

import { drawLabel } from "../ground.js";
import { drawBody, drawSketches, drawTrace, drawTurret } from "./nomaddrawing.js";
import { drawBelief } from "../sensing.js";
import { colourOf } from "../shapes.js";
import { sizesOf } from "../swarm.js";

// "place" is dispatched with {robot, pose} when a robot was dragged there.
export class Traces extends EventTarget {
  constructor(world, windows) {
    super();
    this.world = world;
    this.windows = windows;
    this.held = null; // a robot that is dragged: {robot, pose}
    world.tools.push(this);
    windows.addEventListener("sensed", () => world.repaint("robots"));
  }

  drawUnder(pen) {
    const { world, windows } = this;
    const { view, colours, scene } = world;
    if (world.shows("graphics")) drawSketches(pen, view, windows.sketches, scene.sizes[0][1], colours);
    windows.traces.forEach(([actual, encoder], robot) => {
      const colour = colourOf(robot, colours);
      if (world.shows("encoder")) drawTrace(pen, view, encoder, colour, true);
      if (world.shows("actual")) drawTrace(pen, view, actual, colour, false);
    });
  }

  draw(pen) {
    const { world, windows } = this;
    const { view, colours, scene } = world;
    const sizes = sizesOf(view, scene);
    const boxes = [];
    windows.robots.forEach((robot, index) => {
      if (index >= scene.count) return;
      const [x, y, heading, turret] = windows.real(index);
      const [size, colour] = [sizes(index), colourOf(index, colours)];
      const apart = Math.hypot(robot.believed[0] - x, robot.believed[1] - y) * view.scale;
      const turned = Math.abs(Math.sin((robot.believed[2] - heading) / 2));
      if (world.shows("encoder") && (apart > 2 || turned > 0.02)) drawBelief(pen, view, robot.believed, size, colour);
      drawTurret(pen, view, [x, y, heading, turret], size, colour);
      const said = robot.waiting ? "asks for a place" : robot.touched ? "bump" : "";
      const at = [view.toScreenX(x) + size + 9, view.toScreenY(y) - 16];
      if (said) boxes.push(...drawLabel(pen, view, said, ...at, colours.ink, colours.area, "600 13px", boxes));
    });
    if (!this.held) return;
    const { robot, pose } = this.held;
    drawBody(pen, view, pose, sizes(robot), colourOf(robot, colours), colours, true);
  }

  grab(px, py, event) {
    const { world } = this;
    const robot = event.shiftKey ? -1 : world.at(px, py);
    if (robot < 0) return null;
    const [x0, y0] = world.view.toWorld(px, py);
    const real = this.windows.real(robot);
    return {
      move: (nowX, nowY) => {
        const [x, y] = world.view.toWorld(nowX, nowY);
        this.held = { robot, pose: [real[0] + x - x0, real[1] + y - y0, real[2], real[3]] };
        world.repaint("robots");
      },
      drop: (moved) => {
        const { held } = this;
        this.held = null;
        if (moved && held) this.dispatchEvent(new CustomEvent("place", { detail: held }));
        world.repaint("robots");
      },
    };
  }
}
