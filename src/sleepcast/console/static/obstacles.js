// Changing the obstacles of a simulated world: corners are clicked, one after the other; an obstacle that stands is chosen by a
// click, dragged, and taken away with Delete.

import { encloses } from "./polygon.js";
import { Refusal } from "./wire.js";

const CLOSE = 12; // pixels: a click so near to the first corner ends the polygon
const NEAR = 8; // pixels beside a line within which a wall is meant
const MAX_CORNERS = 64; // as console/incoming.py has it
const BUILD = "Click the corners of a new obstacle, or an obstacle that stands.";
const DRAWING = "The first corner again, or Enter, puts it up; Backspace takes the last corner back.";
const CHOSEN = "Drag it, or take it away.";

export class ObstacleTool {
  // bar: tells what can be done; button: switches it. undo: as of undo.js.
  constructor(world, wire, bar, button, undo) {
    this.undo = undo;
    this.world = world;
    this.wire = wire;
    this.bar = bar;
    this.button = button;
    this.on = false;
    this.corners = []; // of the obstacle that is drawn, x, y in m
    this.pointer = null; // where the next corner would be, m
    this.chosen = -1; // the place of an obstacle
    this.shift = null; // how far the chosen one is being dragged, m
    world.tools.unshift(this); // before the lasso: its clicks are for nobody else
    button.addEventListener("click", () => this.switch(!this.on));
    bar.querySelector(".remove").addEventListener("click", () => this.remove());
    bar.querySelector(".done").addEventListener("click", () => this.switch(false));
    bar.querySelector(".undo").addEventListener("click", () => undo.undo());
    undo.addEventListener("change", () => this.say());
    world.map.addEventListener("keydown", (event) => {
      if (!this.on || event.ctrlKey || event.metaKey || event.altKey || !this.key(event.key)) return;
      event.preventDefault();
      event.stopImmediatePropagation();
    });
    world.map.addEventListener("pointermove", ({ offsetX, offsetY }) => {
      if (!this.corners.length) return;
      this.pointer = world.view.toWorld(offsetX, offsetY);
      world.repaint("robots");
    });
  }

  // Another scene, or other obstacles: what was chosen may not be there any more.
  renew() {
    const { scene } = this.world;
    const may = scene.version !== null && scene.version !== undefined;
    this.button.hidden = !may;
    if (!may) this.switch(false);
    this.choose(-1);
  }

  // Clicks that follow each other fast are corners.
  get busy() {
    return this.on;
  }

  switch(on) {
    this.on = on;
    this.corners = [];
    this.button.setAttribute("aria-pressed", String(on));
    this.world.map.classList.toggle("building", on);
    this.choose(-1);
    if (on) this.world.map.focus();
  }

  choose(place) {
    this.chosen = place;
    this.shift = this.pointer = null;
    this.say();
    this.world.repaint("robots");
  }

  say(refusal = "") {
    this.bar.hidden = !this.on;
    this.bar.querySelector(".remove").hidden = this.chosen < 0;
    const [[last]] = this.undo.choices;
    this.bar.querySelector(".undo").hidden = !this.undo.done.length;
    this.bar.querySelector(".undo").textContent = last;
    this.bar.querySelector(".said").textContent = refusal || (this.corners.length ? DRAWING : this.chosen < 0 ? BUILD : CHOSEN);
  }

  // ---- what the desk is asked

  // verb: what is done to the obstacle.
  change(verb, kind, fields) {
    this.undo.wait(this.ask(verb, kind, fields));
  }

  async ask(verb, kind, fields) {
    try {
      const { change, obstacle } = await this.wire.ask(kind, fields);
      const turn = (again) => this.wire.ask("undo", { change, again });
      this.undo.did(`${verb} obstacle ${obstacle}`, () => turn(false), () => turn(true));
      this.choose(-1);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.shift = null;
      this.say(refusal.message);
    }
  }

  finish() {
    if (this.corners.length < 3) {
      this.say("An obstacle has three corners at least.");
      return;
    }
    const { corners } = this;
    this.corners = [];
    this.change("add", "build", { corners });
  }

  remove() {
    if (this.chosen >= 0) this.change("remove", "clear", { version: this.world.scene.version, place: this.chosen });
  }

  // ---- hands

  // The obstacle at the pixel, or -1: the one around it, or the wall beside it.
  at(px, py) {
    const { view, scene } = this.world;
    const [x, y] = view.toWorld(px, py);
    const around = (outlines) => outlines.filter((outline) => encloses(outline.flat(), x, y)).length % 2 === 1;
    const beside = (outlines) => outlines.some((outline) => outline.some((corner, place) => reach(view, outline.at(place - 1), corner, px, py) < NEAR));
    const index = scene.obstacles.findLastIndex(around);
    return index >= 0 ? index : scene.obstacles.findLastIndex(beside);
  }

  click(px, py) {
    if (!this.on) return false;
    const { view } = this.world;
    if (!this.corners.length) {
      const index = this.at(px, py);
      if (index >= 0 || this.chosen >= 0) {
        this.choose(index);
        return true;
      }
    }
    const [first] = this.corners;
    if (first && Math.hypot(view.toScreenX(first[0]) - px, view.toScreenY(first[1]) - py) < CLOSE) this.finish();
    else if (this.corners.length < MAX_CORNERS) this.corners.push(view.toWorld(px, py));
    this.say();
    this.world.repaint("robots");
    return true;
  }

  grab(px, py) {
    if (!this.on || this.corners.length || this.chosen < 0 || this.at(px, py) !== this.chosen) return null;
    const { view, scene } = this.world;
    const { version } = scene;
    const [x, y] = view.toWorld(px, py);
    return {
      move: (toX, toY) => {
        const [nowX, nowY] = view.toWorld(toX, toY);
        this.shift = [nowX - x, nowY - y];
        this.world.repaint("robots");
      },
      drop: (moved) => {
        if (moved && this.shift) this.change("move", "shift", { version, place: this.chosen, across: this.shift[0], up: this.shift[1] });
      },
    };
  }

  // Whether the key means anything here.
  key(name) {
    if (this.corners.length && name === "Enter") this.finish();
    else if (this.corners.length && name === "Backspace") this.corners.pop();
    else if (this.corners.length && name === "Escape") this.corners = [];
    else if (this.chosen >= 0 && (name === "Delete" || name === "Backspace")) this.remove();
    else if (this.chosen >= 0 && name === "Escape") this.choose(-1);
    else if (name === "Escape") this.switch(false);
    else return false;
    this.say();
    this.world.repaint("robots");
    return true;
  }

  // ---- drawing

  draw(pen) {
    if (!this.on) return;
    const { view, scene, colours } = this.world;
    pen.strokeStyle = pen.fillStyle = colours.chosen;
    pen.lineWidth = 2.5;
    if (this.chosen >= 0 && scene.obstacles[this.chosen]) {
      const [dx, dy] = this.shift ?? [0, 0];
      pen.setLineDash(this.shift ? [6, 4] : []);
      pen.beginPath();
      for (const outline of scene.obstacles[this.chosen]) {
        pen.moveTo(view.toScreenX(outline[0][0] + dx), view.toScreenY(outline[0][1] + dy));
        for (const [x, y] of outline) pen.lineTo(view.toScreenX(x + dx), view.toScreenY(y + dy));
        pen.closePath();
      }
      pen.stroke();
      pen.setLineDash([]);
    }
    if (!this.corners.length) return;
    pen.beginPath();
    for (const [x, y] of this.pointer ? [...this.corners, this.pointer] : this.corners) pen.lineTo(view.toScreenX(x), view.toScreenY(y));
    pen.stroke();
    for (const [x, y] of this.corners) pen.fillRect(view.toScreenX(x) - 4, view.toScreenY(y) - 4, 8, 8);
  }
}

// How far a pixel lies from the line between two corners.
function reach(view, from, to, px, py) {
  const [x, y, toX, toY] = [view.toScreenX(from[0]), view.toScreenY(from[1]), view.toScreenX(to[0]), view.toScreenY(to[1])];
  const length = (toX - x) ** 2 + (toY - y) ** 2;
  const along = length ? Math.min(1, Math.max(0, ((px - x) * (toX - x) + (py - y) * (toY - y)) / length)) : 0;
  return Math.hypot(x + along * (toX - x) - px, y + along * (toY - y) - py);
}
