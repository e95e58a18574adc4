// The Robot window: the world as the chosen robot sees it, by its own belief. Its path, what its sonars saw, and, where
// a program asks for a place, a click that answers.

import { drawGrid, drawLabel } from "../ground.js";
import { drawCones, drawTouches, sizeOf } from "../sensing.js";
import { colourOf, drawBody, drawCrosses, drawDots, drawTrace } from "./drawing.js";
import { Pane } from "./pane.js";

const NOTHING = 254.5; // inches: a sonar that reads this or more has heard nothing
const NOT_NEAR = 24; // inches: farther than infrared sensors see
const BEGIN = 60; // inches in sight to every side at the start
const SPEECH = 6; // simulated seconds for which what it said stands beside it

export class Own extends Pane {
  constructor(root, state) {
    super(root.querySelector("#own"), ["own-canvas"]);
    this.root = root;
    this.state = state;
    this.following = true;
    root.querySelector("#follow").addEventListener("click", () => this.follow(!this.following));
  }

  // The first words have come, or another robot is looked at.
  begin() {
    this.view.scale = Math.min(this.view.width, this.view.height) / (2 * BEGIN * 10 * this.state.tenth);
    this.view.whole = this.view.scale;
    this.follow(true);
  }

  resized() {
    if (this.state.tenth && this.following) this.begin();
  }

  follow(on) {
    this.following = on;
    this.root.querySelector("#follow").setAttribute("aria-pressed", String(on));
    this.repaint();
  }

  pan(dx, dy) {
    this.follow(false);
    super.pan(dx, dy);
  }

  zoom(factor, x, y) {
    if (this.following) super.zoom(factor);
    else super.zoom(factor, x, y);
  }

  click(px, py) {
    if (!this.state.robot?.waiting) return;
    const [x, y] = this.view.toWorld(px, py);
    this.dispatchEvent(new CustomEvent("answer", { detail: { robot: this.state.chosen, x, y } }));
  }

  key(event) {
    if (event.key === "c" || event.key === "C") this.follow(true);
    else if (event.key === "Enter") this.click(this.view.width / 2, this.view.height / 2);
    else return super.key(event);
    return true;
  }

  draw() {
    const { view, state, colours } = this;
    const pen = this.pens["own-canvas"];
    const { robot, kind, own, shown } = state;
    pen.fillStyle = colours.area;
    pen.fillRect(0, 0, view.width, view.height);
    if (!robot) return;
    if (this.following) view.centre(robot.believed[0], robot.believed[1]);
    if (state.grid * view.scale >= 8) drawGrid(pen, view, state.grid, colours.grid);
    const colour = colourOf(state.chosen, colours);
    if (shown.encoder) drawTrace(pen, view, state.traces[state.chosen][1], colour, true);
    if (shown.sonar) drawDots(pen, view, state.echoes, 3, colours.ink);
    if (shown.bumper) drawCrosses(pen, view, state.contacts, 4, colours.place);
    if (own) this.drawSensors(pen, robot, kind, own, colour);
    drawBody(pen, view, robot.believed, kind.radius, colour, colours);
    if (own && shown.bumper) drawTouches(pen, view, robot.believed, sizeOf(view, kind.radius), own.touched, colours.place);
    const last = state.said.at(-1);
    if (last && state.time - last[0] < SPEECH) {
      const size = sizeOf(view, kind.radius);
      const [x, y] = [view.toScreenX(robot.believed[0]) + 0.8 * size, view.toScreenY(robot.believed[1]) - size - 10];
      drawLabel(pen, view, `“${last[1]}”`, x, y, colours.ink, colours.area, "13px", []);
    }
  }

  drawSensors(pen, robot, kind, own, colour) {
    const inch = 10 * this.state.tenth;
    const { shown } = this.state;
    if (shown.sonar) drawCones(pen, this.view, robot.believed, kind.radius, own.sonars, NOTHING * inch, colour);
    if (shown.infrared) {
      const near = own.infrared.map((metres) => (metres < NOT_NEAR * inch ? metres : null));
      drawCones(pen, this.view, robot.believed, kind.radius, near, Infinity, this.colours.lit);
    }
  }
}
