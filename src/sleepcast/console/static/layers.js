// The layers of the map, and what can be done with it: a small menu beside the zoom buttons. What is shown is remembered.

import { keep, kept } from "./kept.js";

const KEY = "layers";
// on: whether it is shown until somebody chooses; null: where there are many robots.
const LAYERS = [
  { name: "trails", title: "Trails", key: "T", on: true },
  { name: "names", title: "Names", on: true },
  { name: "picture", title: "Picture under the map", on: true, hint: "That of the scenario's map, or one that you choose" },
  { name: "pings", title: "Pings", on: true },
  { name: "density", title: "Density", on: null, hint: "How many robots are where. Shown by itself while more than 20,000 are in sight." },
  { name: "sensors", title: "Sensors of the chosen robot", on: false, hint: "Its sonars, what it touches, and how far it senses" },
  { name: "encoders", title: "Encoder position of the chosen robot", on: false, hint: "Where its wheels tell it to be" },
];

export class Layers {
  // menu: the element that holds the layers. button: opens it. undo: as of undo.js.
  constructor(menu, button, world, undo) {
    this.undo = undo;
    this.menu = menu;
    this.button = button;
    this.world = world;
    this.shown = { ...Object.fromEntries(LAYERS.map(({ name, on }) => [name, on])), ...kept(KEY, {}) };
    this.boxes = new Map(LAYERS.map((layer) => [layer.name, this.line(layer)]));
    menu.prepend(...[...this.boxes.values()].map((box) => box.parentElement));
    button.addEventListener("click", () => this.open(menu.hidden));
    menu.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.open(false);
      button.focus();
      event.stopPropagation();
    });
    document.addEventListener("pointerdown", ({ target }) => {
      if (!menu.hidden && !menu.contains(target) && !button.contains(target)) this.open(false);
    });
    world.setLayers(this.shown);
  }

  line({ name, title, key, hint }) {
    const box = Object.assign(document.createElement("input"), { type: "checkbox", id: `layer-${name}`, checked: Boolean(this.shown[name]) });
    box.addEventListener("change", () => this.set(name, box.checked));
    const label = document.createElement("label");
    if (hint) label.title = hint;
    label.append(box, title);
    if (key) label.append(Object.assign(document.createElement("kbd"), { textContent: key }));
    return box;
  }

  open(on) {
    if (on) for (const [name, box] of this.boxes) box.checked = this.world.shows(name);
    this.menu.hidden = !on;
    this.button.setAttribute("aria-expanded", String(on));
    if (on) this.menu.querySelector("input").focus();
  }

  set(name, on) {
    const before = this.shown[name];
    this.put(name, on);
    const title = LAYERS.find((layer) => layer.name === name).title.toLowerCase();
    this.undo.did(`${on ? "show" : "hide"} ${title}`, () => this.put(name, before), () => this.put(name, on));
  }

  put(name, on) {
    this.shown[name] = on;
    this.boxes.get(name).checked = on;
    keep(KEY, this.shown);
    this.world.setLayers(this.shown);
  }

  toggle(name) {
    this.set(name, !this.world.shows(name));
  }
}
