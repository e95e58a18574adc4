// Adding robots to a run: a click on the map puts one there, Enter one where robots of its table start.

import { Refusal } from "./wire.js";

const ADD = "Click where the robot is to stand; Enter adds one by chance.";

export class ArrivalTool {
  // bar: tells what can be done; button: switches it; others: tools that are switched off meanwhile.
  constructor(world, wire, bar, button, others) {
    this.world = world;
    this.wire = wire;
    this.bar = bar;
    this.button = button;
    this.others = others;
    this.kinds = bar.querySelector(".kinds");
    this.on = false;
    this.pointer = null; // where the robot would stand, m
    world.tools.unshift(this); // before the lasso: its clicks are for nobody else
    button.addEventListener("click", () => this.switch(!this.on));
    bar.querySelector(".chance").addEventListener("click", () => this.add());
    bar.querySelector(".done").addEventListener("click", () => this.switch(false));
    world.map.addEventListener("keydown", (event) => {
      if (!this.on || event.ctrlKey || event.metaKey || event.altKey || !this.key(event.key)) return;
      event.preventDefault();
      event.stopImmediatePropagation();
    });
    world.map.addEventListener("pointermove", ({ offsetX, offsetY }) => this.point(world.view.toWorld(offsetX, offsetY)));
    world.map.addEventListener("pointerleave", () => this.point(null));
  }

  // Another scene.
  renew() {
    const kinds = this.world.scene.addable ?? [];
    this.button.hidden = !kinds.length;
    if (!kinds.length) this.switch(false);
    this.kinds.replaceChildren(...kinds.map((kind) => new Option(kind, kind)));
    this.kinds.hidden = kinds.length < 2;
  }

  // Clicks that follow each other fast are robots.
  get busy() {
    return this.on;
  }

  switch(on) {
    this.on = on;
    this.point(null);
    this.button.setAttribute("aria-pressed", String(on));
    this.bar.hidden = !on;
    if (on) for (const other of this.others) other.switch(false);
    this.world.map.classList.toggle("building", on || this.others.some((other) => other.on));
    if (!on) return;
    this.say(ADD);
    this.world.map.focus();
  }

  say(text) {
    this.bar.querySelector(".said").textContent = text;
  }

  point(place) {
    if (!this.on && !this.pointer) return;
    this.pointer = this.on ? place : null;
    this.world.repaint("robots");
  }

  // place: x and y in m; without them it stands where robots of its table start.
  async add(place = {}) {
    try {
      const { robot } = await this.wire.ask("addrobot", { kind: this.kinds.value, ...place });
      this.say(`${robot} is there. ${ADD}`);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message);
    }
  }

  // ---- hands

  click(px, py) {
    if (!this.on) return false;
    const [x, y] = this.world.view.toWorld(px, py);
    this.add({ x, y });
    return true;
  }

  // Whether the key means anything here.
  key(name) {
    if (name === "Enter") this.add();
    else if (name === "Escape") this.switch(false);
    else return false;
    return true;
  }

  // ---- drawing

  draw(pen) {
    if (!this.pointer) return;
    const { view, colours } = this.world;
    pen.strokeStyle = colours.chosen;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(view.toScreenX(this.pointer[0]), view.toScreenY(this.pointer[1]), 7, 0, 2 * Math.PI);
    pen.stroke();
  }
}
