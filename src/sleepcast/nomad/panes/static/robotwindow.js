// The Robot window: the world as the chosen robot sees it, by its own belief. Its path, what its sonars saw, and, where
// a program asks for a place, a click that answers.

import { showAs, wholePixels, write } from "../elements.js";
import { gestures } from "../gestures.js";
import { drawGrid, drawLabel } from "../ground.js";
import { drawBody, drawCrosses, drawDots, drawTrace } from "./nomaddrawing.js";
import { drawCones, drawTouches, sizeOf } from "../sensing.js";
import { colourOf } from "../shapes.js";
import { gridStep, View } from "../view.js";

const BEGIN = 1.5; // m in sight to every side at the start
const SPEECH = 6; // simulated seconds for which what it said stands beside it
const ZOOM_STEP = 1.4;
const PAN_STEP = 60; // pixels
const LINES = 60; // pixels between two lines of the grid at most
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

// "answer" is dispatched with {robot, x, y} when a program asks for a place and somebody points at it.
export class RobotWindow extends EventTarget {
  constructor(root, windows) {
    super();
    this.find = (id) => root.querySelector(`#${id}`);
    this.root = root;
    this.windows = windows;
    this.pen = root.querySelector("canvas").getContext("2d");
    this.view = new View();
    this.following = true;
    this.waiting = false;
    this.said = null; // {at, text} that the robot said last
    new ResizeObserver(() => this.resize()).observe(root);
    gestures(root, {
      drag: (dx, dy) => this.pan(dx, dy),
      click: (x, y) => this.click(x, y),
      hover: () => {},
      zoom: (factor, x, y) => this.zoom(factor, x, y),
    });
    root.addEventListener("keydown", (event) => {
      if (!event.ctrlKey && !event.metaKey && !event.altKey && this.key(event)) event.preventDefault();
    });
    this.find("own-follow").addEventListener("click", () => this.follow(true));
    this.find("own-follow").addEventListener("pointerdown", (event) => event.stopPropagation()); // it is no place
    windows.addEventListener("sensed", () => this.show());
    windows.world.addEventListener("layers", () => this.repaint());
    windows.world.addEventListener("choose", () => this.begin());
  }

  resize() {
    const ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = wholePixels(this.root, ratio);
    if (!width || !height) return;
    const { canvas } = this.pen;
    showAs(canvas, width, height);
    [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.view.resize(width, height);
    if (this.following) this.begin();
    this.draw();
  }

  // Another robot is looked at.
  begin() {
    this.said = null;
    this.view.scale = this.view.whole = Math.min(this.view.width, this.view.height) / (2 * BEGIN);
    this.follow(true);
  }

  follow(on) {
    this.following = on;
    this.find("own-follow").hidden = on;
    this.repaint();
  }

  pan(dx, dy) {
    this.follow(false);
    this.view.pan(dx, dy);
  }

  zoom(factor, x, y) {
    if (this.following) this.view.zoom(factor);
    else this.view.zoom(factor, x, y);
    this.repaint();
  }

  click(px, py) {
    if (!this.windows.robot?.waiting) return;
    const [x, y] = this.view.toWorld(px, py);
    this.dispatchEvent(new CustomEvent("answer", { detail: { robot: this.windows.chosen, x, y } }));
  }

  // Do what a key means here; whether it means anything.
  key(event) {
    const arrow = ARROWS[event.key];
    if (arrow && event.shiftKey) this.pan(-PAN_STEP * arrow[0], -PAN_STEP * arrow[1]);
    else if (event.key === "+" || event.key === "=") this.zoom(ZOOM_STEP);
    else if (event.key === "-" || event.key === "_") this.zoom(1 / ZOOM_STEP);
    else if (event.key === "c" || event.key === "C") this.follow(true);
    else if (event.key === "Enter" && event.target === this.root) this.click(this.view.width / 2, this.view.height / 2);
    else return false;
    return true;
  }

  // ---- what is shown

  // lines: what the robot said, the youngest first, as of the robot pane.
  setSaid(lines) {
    this.said = lines[0] ?? null;
  }

  show() {
    const { robot } = this.windows;
    this.find("contest").hidden = !robot?.rivals;
    if (robot?.rivals) write(this.find("contest"), `Driven by ${robot.rivals}: each replaces what the other asks.`);
    this.find("asked").hidden = !robot?.waiting;
    if (robot?.waiting) write(this.find("asked"), "A program asks for a place: click one here, or press Enter for the middle.");
    this.repaint();
  }

  repaint() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    const { view, windows, pen } = this;
    const { robot, body, world, chosen } = windows;
    const { colours } = world;
    pen.fillStyle = colours.area;
    pen.fillRect(0, 0, view.width, view.height);
    if (!robot || !world.frame) return;
    const [x, y] = robot.believed;
    if (this.following) view.centre(x, y);
    drawGrid(pen, view, gridStep(view, world.scene.unit, LINES).metres, colours.grid);
    const radius = world.scene.sizes[chosen][1];
    const [size, colour] = [sizeOf(view, radius), colourOf(chosen, colours)];
    if (world.shows("encoder")) drawTrace(pen, view, windows.traces[chosen][1], colour, true);
    if (world.shows("sonar")) drawDots(pen, view, windows.echoes, 3, colours.ink);
    if (world.shows("bumper")) drawCrosses(pen, view, windows.contacts, 4, colours.place);
    if (body && world.shows("sonar")) drawCones(pen, view, robot.believed, radius, body.sonars, body.farthest, colour);
    if (body && world.shows("infrared")) {
      const near = body.infrared.map((metres) => (metres < body.sight ? metres : null));
      drawCones(pen, view, robot.believed, radius, near, Infinity, colours.lit);
    }
    drawBody(pen, view, robot.believed, size, colour, colours);
    if (body && world.shows("bumper")) drawTouches(pen, view, robot.believed, size, body.touched, colours.place);
    if (!this.said || world.frame.time - this.said.at > SPEECH) return;
    const at = [view.toScreenX(x) + 0.8 * size, view.toScreenY(y) - size - 10];
    drawLabel(pen, view, `“${this.said.text}”`, ...at, colours.ink, colours.area, "13px", []);
  }
}
