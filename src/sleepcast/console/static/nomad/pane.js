// A pane: canvases one above the other that show a part of the world, and hands that move in it.
//
// Nothing is drawn but in `draw`, at most once for each picture of the screen, and only the layers that are stale.

import { gestures } from "../gestures.js";
import { palette } from "../shapes.js";
import { View } from "../view.js";

const ZOOM_STEP = 1.4;
const PAN_STEP = 60; // pixels
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Pane extends EventTarget {
  // box: the element that holds the canvases. layers: their ids, lowest first.
  constructor(box, layers) {
    super();
    this.box = box;
    this.pens = Object.fromEntries(layers.map((id) => [id, box.querySelector(`#${id}`).getContext("2d")]));
    this.view = new View();
    this.colours = palette();
    this.stale = new Set();
    this.waiting = false;
    new ResizeObserver(() => this.resize()).observe(box);
    gestures(box, {
      drag: (dx, dy) => this.pan(dx, dy),
      click: (x, y) => this.click(x, y),
      hover: (x, y) => this.hover(x, y),
      zoom: (factor, x, y) => this.zoom(factor, x, y),
      grab: (x, y) => this.grab(x, y),
      busy: () => this.busy,
    });
    box.addEventListener("keydown", (event) => {
      if (!event.ctrlKey && !event.metaKey && !event.altKey && this.key(event)) event.preventDefault();
    });
  }

  // What a pane may make of these; see gestures.js.
  click() {}
  hover() {}
  grab() {
    return null;
  }
  get busy() {
    return false;
  }

  resize() {
    const { width, height } = this.box.getBoundingClientRect();
    if (!width || !height) return;
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    for (const pen of Object.values(this.pens)) {
      pen.canvas.width = Math.round(width * ratio);
      pen.canvas.height = Math.round(height * ratio);
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    }
    this.view.resize(width, height);
    this.resized();
    this.repaint();
  }

  resized() {}

  recolour() {
    this.colours = palette();
    this.repaint();
  }

  pan(dx, dy) {
    this.view.pan(dx, dy);
    this.moved();
  }

  zoom(factor, x, y) {
    this.view.zoom(factor, x, y);
    this.moved();
  }

  // The view is another one.
  moved() {
    this.repaint();
  }

  repaint(...layers) {
    for (const layer of layers.length ? layers : Object.keys(this.pens)) this.stale.add(layer);
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      const { stale } = this;
      this.stale = new Set();
      this.draw(stale);
    });
  }

  // Do what a key means here; whether it means anything.
  key(event) {
    const arrow = ARROWS[event.key];
    if (arrow && event.shiftKey) this.pan(-PAN_STEP * arrow[0], -PAN_STEP * arrow[1]);
    else if (event.key === "+" || event.key === "=") this.zoom(ZOOM_STEP);
    else if (event.key === "-" || event.key === "_") this.zoom(1 / ZOOM_STEP);
    else return false;
    return true;
  }
}
