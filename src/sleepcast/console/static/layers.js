// The layers of the map, and what can be done with it: a small menu beside the zoom buttons. What is shown is remembered.

import { make } from "./elements.js";
import { keep, kept } from "./kept.js";

const KEY = "layers";
// on: whether it is shown until somebody chooses; null: where there are many robots. order: what erases it, if anything does.
export const SWARM_LAYERS = [
  { name: "trails", title: "Trails", key: "T", on: true },
  { name: "names", title: "Names", on: true },
  { name: "height", title: "Height", on: true, hint: "How high robots fly: a disc behind each, and the scale of its shades" },
  { name: "footprints", title: "Footprints of cameras", on: true, hint: "What robots that fly see of the ground below them" },
  { name: "picture", title: "Picture under the map", on: true, hint: "That of the scenario's map, or one that you choose" },
  { name: "relief", title: "Hills", on: true, hint: "How high the ground is: the more ink, the higher" },
  { name: "field", title: "Field", on: true, hint: "What fills the world, such as a scent, with its scale" },
  { name: "pings", title: "Pings", on: true },
  { name: "density", title: "Density", on: null, hint: "How many robots are where. Shown by itself while more than 20,000 are in sight." },
  { name: "sensors", title: "Sensors of the chosen robot", on: false, hint: "Its sonars, what it touches, and how far it senses" },
  { name: "sight", title: "Sight of the chosen robot", on: false },
  { name: "encoders", title: "Encoder position of the chosen robot", on: false, hint: "Where its wheels tell it to be" },
];

// "erase" is dispatched with the order that erases a layer.
export class Layers extends EventTarget {
  // menu: the element that holds the layers. button: opens it. undo: as of undo.js.
  constructor(menu, button, world, layers, undo) {
    super();
    this.undo = undo;
    this.menu = menu;
    this.button = button;
    this.world = world;
    const before = kept(KEY, {});
    this.shown = Object.fromEntries(layers.map(({ name, on }) => [name, before[name] ?? on]));
    this.titles = new Map(layers.map(({ name, title }) => [name, title]));
    this.boxes = new Map(layers.map((layer) => [layer.name, this.line(layer)]));
    menu.prepend(...[...this.boxes.values()].map((box) => box.closest(".layer")));
    if (layers.some(({ order }) => order)) menu.querySelector(".exports").prepend(this.eraser("refresh_all", "Erase all layers"));
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
    world.map.addEventListener("focus", () => this.open(false)); // what the menu has begun goes on there, and it would hide it
    world.setLayers(this.shown);
  }

  line({ name, title, key, hint = "", order }) {
    const box = make("input", { type: "checkbox", id: `layer-${name}`, checked: Boolean(this.shown[name]) });
    box.addEventListener("change", () => this.set(name, box.checked));
    const label = make("label", { title: hint }, box, title, ...(key ? [make("kbd", {}, key)] : []));
    const eraser = order ? [this.eraser(order, "Erase", `Erase: ${title}`)] : [];
    make("div", { className: "layer" }, label, ...eraser);
    return box;
  }

  eraser(order, text, title = "") {
    const button = make("button", { type: "button", title }, text);
    button.dataset.erase = order;
    button.addEventListener("click", () => this.dispatchEvent(new CustomEvent("erase", { detail: order })));
    return button;
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
    const title = this.titles.get(name).toLowerCase();
    this.undo.did(`${on ? "show" : "hide"} ${title}`, () => this.put(name, before), () => this.put(name, on));
  }

  put(name, on) {
    this.shown[name] = on;
    this.boxes.get(name).checked = on;
    keep(KEY, { ...kept(KEY, {}), ...this.shown });
    this.world.setLayers(this.shown);
  }

  toggle(name) {
    this.set(name, !this.world.shows(name));
  }
}
