// The World window: every robot where it is and where it believes to be, both traces, what is solid, and what programs
// have drawn. Robots and obstacles can be dragged, obstacles drawn.

import { drawGrid, drawLabel } from "../ground.js";
import { gridStep } from "../view.js";
import { Builder } from "./builder.js";
import { drawBelief, drawCones, drawTouches, sizeOf } from "../sensing.js";
import { colourOf, drawBody } from "./drawing.js";
import { drawSketches, drawSolids, drawTrace } from "./drawing.js";
import { Pane } from "./pane.js";

const NEAR = 12; // pixels: how far beside a robot a click may be
const NOTHING = 254.5; // inches: a sonar that reads this or more has heard nothing
const WIDEST = 160; // pixels of the scale beside the map
const FINEST = 8; // pixels between two lines of the grid; beyond, every tenth one is drawn

export class World extends Pane {
  constructor(root, state) {
    super(root.querySelector("#map"), ["ground", "trails", "robots"]);
    this.root = root;
    this.state = state;
    this.fitted = true;
    this.held = null; // a robot that is dragged: {robot, pose}
    this.builder = new Builder(root, state, this);
    root.querySelector("#zoom-in").addEventListener("click", () => this.zoom(1.4));
    root.querySelector("#zoom-out").addEventListener("click", () => this.zoom(1 / 1.4));
    root.querySelector("#fit").addEventListener("click", () => this.fit());
    root.querySelector("#centre").addEventListener("click", () => this.centre());
  }

  // ---- the view

  resized() {
    this.refit();
  }

  fit() {
    if (!this.state.area) return;
    this.view.fit(this.state.extent());
    this.moved(true);
  }

  // Something new has come: it is shown whole, unless somebody has moved the map.
  refit() {
    if (this.fitted) this.fit();
  }

  centre() {
    const { robot } = this.state;
    if (!robot) return;
    this.view.centre(robot.real[0], robot.real[1]);
    this.moved();
  }

  moved(fitted = false) {
    this.fitted = fitted;
    this.repaint();
  }

  // ---- drawing

  draw(stale) {
    const { pens, state } = this;
    if (!state.area) return;
    if (stale.has("ground")) this.drawGround(pens.ground);
    if (stale.has("trails")) this.drawTrails(pens.trails);
    if (stale.has("robots")) this.drawRobots(pens.robots);
    this.dispatchEvent(new Event("drawn"));
  }

  drawGround(pen) {
    const { view, state, colours } = this;
    const [left, bottom, right, top] = state.area;
    const edge = [view.toScreenX(left), view.toScreenY(top), (right - left) * view.scale, (top - bottom) * view.scale];
    pen.fillStyle = colours.ground;
    pen.fillRect(0, 0, view.width, view.height);
    pen.fillStyle = colours.area;
    pen.fillRect(...edge);
    const step = state.grid * view.scale < FINEST ? 10 * state.grid : state.grid;
    if (step * view.scale >= FINEST) drawGrid(pen, view, step, colours.grid);
    drawSolids(pen, view, state.solids, this.builder.chosen, colours);
    pen.strokeStyle = colours.wall;
    pen.lineWidth = 2;
    pen.strokeRect(...edge);
    const own = { metres: step, label: `${state.inches(step)} in` };
    const shown = step * view.scale <= WIDEST ? own : gridStep(view, "in", WIDEST);
    this.root.querySelector("#scale-bar").style.width = `${shown.metres * view.scale}px`;
    this.root.querySelector("#scale-text").textContent = shown.label;
  }

  drawTrails(pen) {
    const { view, state, colours } = this;
    pen.clearRect(0, 0, view.width, view.height);
    if (state.shown.graphics && state.kind) drawSketches(pen, view, state.sketches, state.kind.radius, colours);
    state.traces.forEach(([actual, encoder], robot) => {
      const colour = colourOf(robot, colours);
      if (state.shown.encoder) drawTrace(pen, view, encoder, colour, true);
      if (state.shown.actual) drawTrace(pen, view, actual, colour, false);
    });
  }

  drawRobots(pen) {
    const { view, state, colours } = this;
    pen.clearRect(0, 0, view.width, view.height);
    if (state.own && state.robot) this.drawSensors(pen, state);
    const boxes = [];
    state.robots.forEach((robot, index) => {
      const { radius, name } = state.kinds[index];
      const colour = colourOf(index, colours);
      const [x, y, heading] = robot.real;
      const apart = Math.hypot(robot.believed[0] - x, robot.believed[1] - y) * view.scale;
      const turned = Math.abs(Math.sin((robot.believed[2] - heading) / 2));
      if (state.shown.encoder && (apart > 2 || turned > 0.02)) drawBelief(pen, view, robot.believed, sizeOf(view, radius), colour);
      const held = this.held?.robot === index;
      drawBody(pen, view, robot.real, radius, colour, colours, { chosen: index === state.chosen, faint: held });
      if (held) drawBody(pen, view, this.held.pose, radius, colour, colours, { chosen: true });
      const at = [view.toScreenX(x) + sizeOf(view, radius) + 5, view.toScreenY(y) - sizeOf(view, radius) * 0.6];
      const asks = robot.waiting ? "  asks for a place" : robot.touched ? "  bump" : "";
      boxes.push(...drawLabel(pen, view, `${name}${asks}`, ...at, colours.ink, colours.area, "600 13px", boxes));
    });
    if (state.shown.bumper && state.own && state.robot) {
      drawTouches(pen, view, state.robot.real, sizeOf(view, state.kind.radius), state.own.touched, colours.place);
    }
    this.builder.draw(pen, view, colours);
  }

  // What the chosen robot's sensors see now, from where it really is.
  drawSensors(pen, state) {
    const colour = colourOf(state.chosen, this.colours);
    const farthest = NOTHING * 10 * state.tenth;
    if (state.shown.sonar) {
      drawCones(pen, this.view, state.robot.real, state.kind.radius, state.own.sonars, farthest, colour);
    }
  }

  // ---- hands

  // The robot under the pixel, or -1.
  at(px, py) {
    let best = Infinity;
    let found = -1;
    this.state.robots.forEach(({ real }, index) => {
      const away = Math.hypot(this.view.toScreenX(real[0]) - px, this.view.toScreenY(real[1]) - py);
      const reach = Math.max(NEAR, sizeOf(this.view, this.state.kinds[index].radius));
      if (away < Math.min(best, reach)) [best, found] = [away, index];
    });
    return found;
  }

  click(px, py) {
    if (this.builder.click(px, py)) return;
    const found = this.at(px, py);
    if (found >= 0) {
      this.builder.choose(-1);
      this.dispatchEvent(new CustomEvent("choose", { detail: found }));
    } else this.builder.choose(this.builder.at(px, py));
  }

  hover(px, py) {
    const { state } = this;
    if (px === null || !state.area) {
      this.root.querySelector("#place-text").textContent = "";
      return;
    }
    const [x, y] = this.view.toWorld(px, py);
    this.root.querySelector("#place-text").textContent = `x ${state.tenths(x)}  y ${state.tenths(y)}  (1/10 in)`;
    const something = this.at(px, py) >= 0 || this.builder.at(px, py) >= 0;
    this.box.classList.toggle("pointing", !this.builder.drawing && something);
    this.builder.hover(px, py);
  }

  grab(px, py) {
    if (this.builder.drawing) return null;
    const robot = this.at(px, py);
    if (robot < 0) return this.builder.grab(px, py);
    const [x0, y0] = this.view.toWorld(px, py);
    const { real } = this.state.robots[robot];
    return {
      move: (nowX, nowY) => {
        const [x, y] = this.view.toWorld(nowX, nowY);
        this.held = { robot, pose: [real[0] + x - x0, real[1] + y - y0, real[2], real[3]] };
        this.repaint("robots");
      },
      drop: (moved) => {
        const { held } = this;
        this.held = null;
        if (moved && held) this.dispatchEvent(new CustomEvent("place", { detail: held }));
        this.repaint("robots");
      },
    };
  }

  get busy() {
    return this.builder.drawing;
  }

  key(event) {
    if (this.builder.key(event)) return true;
    if (event.key === "f" || event.key === "F") this.fit();
    else if (event.key === "c" || event.key === "C") this.centre();
    else return super.key(event);
    return true;
  }
}
