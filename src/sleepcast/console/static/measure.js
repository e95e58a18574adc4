// Measuring a distance on the map: press M or the button, and drag a line; or choose one robot after another. The line says
// how long it is, in the map's unit, until the next one or until M is pressed again.

import { drawLabel } from "./ground.js";
import { font } from "./type.js";
import { UNITS } from "./view.js";

export class Measure {
  // button: switches it. said: the element that tells it to screen readers.
  constructor(world, button, said) {
    this.world = world;
    this.button = button;
    this.said = said;
    this.on = false;
    this.line = null; // from x, y to x, y, m
    this.robot = null; // where the robot was that was chosen last, m
    world.tools.push(this);
    button.addEventListener("click", () => this.switch(!this.on));
    world.addEventListener("choose", ({ detail }) => this.chosen(detail));
    world.map.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === "m" || event.key === "M") this.switch(!this.on);
      else if (event.key === "Escape" && this.on) this.switch(false);
    });
  }

  switch(on) {
    this.on = on;
    this.line = this.robot = null;
    this.button.setAttribute("aria-pressed", String(on));
    this.world.map.classList.toggle("measuring", on);
    if (on) this.chosen(this.world.marks.chosen);
    this.world.repaint("robots");
  }

  grab(x, y, event) {
    if (!this.on || event.shiftKey) return null;
    const from = this.world.view.toWorld(x, y);
    return {
      move: (toX, toY) => this.span(from, this.world.view.toWorld(toX, toY)),
      drop: (moved) => moved && this.tell(),
    };
  }

  // A robot was chosen: the line leads to it from the one before.
  chosen(robot) {
    if (!this.on) return;
    const { frame } = this.world;
    const at = robot < 0 || !frame ? null : [frame.poses[3 * robot], frame.poses[3 * robot + 1]];
    if (at && this.robot) {
      this.span(this.robot, at);
      this.tell();
    }
    this.robot = at;
  }

  span(from, to) {
    this.line = [...from, ...to];
    this.world.repaint("robots");
  }

  get text() {
    const [x, y, toX, toY] = this.line;
    const { unit } = this.world.scene;
    const length = Math.hypot(toX - x, toY - y) / UNITS[unit];
    return `${length.toLocaleString("en", { maximumSignificantDigits: 4 })} ${unit}`;
  }

  tell() {
    this.said.textContent = this.text;
  }

  draw(pen) {
    if (!this.line) return;
    const { view, colours } = this.world;
    const [x, toX] = [view.toScreenX(this.line[0]), view.toScreenX(this.line[2])];
    const [y, toY] = [view.toScreenY(this.line[1]), view.toScreenY(this.line[3])];
    const away = Math.hypot(toX - x, toY - y) || 1;
    const [across, up] = [(6 * (toY - y)) / away, (-6 * (toX - x)) / away]; // half a stroke at each end
    pen.beginPath();
    pen.moveTo(x, y);
    pen.lineTo(toX, toY);
    for (const [endX, endY] of [[x, y], [toX, toY]]) {
      pen.moveTo(endX - across, endY - up);
      pen.lineTo(endX + across, endY + up);
    }
    pen.lineCap = "round";
    pen.strokeStyle = colours.area;
    pen.lineWidth = 5;
    pen.stroke();
    pen.strokeStyle = colours.ink;
    pen.lineWidth = 1.8;
    pen.stroke();
    pen.lineCap = "butt";
    drawLabel(pen, view, this.text, (x + toX) / 2 + 8, (y + toY) / 2 - 12, colours.ink, colours.area, font(13, 600), []);
  }
}
