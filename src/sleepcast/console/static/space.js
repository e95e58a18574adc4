// The view in three dimensions beside the map: the same robots, of the same frame and in the same colours, and what is
// picked in one is picked in the other. It is opened by its button or by V, and only then is three.js fetched.
//
// For what is drawn over the robots and for what hands do, it is another `surface` like the map: robots stand in pixels in
// its `frame`, and its `view` takes them as they are.

import { showAs, wholePixels } from "./elements.js";
import { Fineness } from "./fineness.js";
import { CRASHED } from "./frame.js";
import { gestures } from "./gestures.js";
import { drawGround, drawPlaces } from "./ground.js";
import { keep, kept } from "./kept.js";
import { Labels } from "./labels.js";
import { Orbit } from "./orbit.js";
import { Painting } from "./painting.js";
import { inkOf, inksOf, LOOKS } from "./shapes.js";
import { drawRings, robotAt, robotBeside } from "./swarm.js";
import { grown } from "./type.js";
import { trailLines } from "./trails.js";
import { heightText, View } from "./view.js";

const KEY = "space";
const SHEET = 2048; // pixels of the longer side of the ground
const SMALLEST = 5; // pixels: half a robot's length at least
const WALL_RADII = 4; // radii of the largest body that walls without a limit of their height are high,
const WALL_SHARE = 0.004; // at least this part of the world's longer side, and as high as all others
const DIMMED = 0.45; // of the colour of robots outside the lit ones
const ZOOM_STEP = 1.4;
const TURN_STEP = 40; // pixels of a hand that Shift and an arrow key are
const CIRCLE = Array.from({ length: 48 }, (_, corner) => [Math.cos((corner * Math.PI) / 24), Math.sin((corner * Math.PI) / 24)]);
const ELSEWHERE = "Turn on WebGL in its settings, or use another one."; // a browser's
const AGAIN = "This is a fault of the page: its button opens the view again, and a report of these words helps to mend it.";
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Space {
  // root: its pane. button: opens it. said: called with a sentence when it cannot be shown.
  constructor(root, button, world, said) {
    this.root = root;
    this.button = button;
    this.world = world;
    this.said = said;
    this.map = root.querySelector(".space-map");
    this.tip = root.querySelector(".tip");
    this.from = root.querySelector(".from");
    [this.canvas, this.over] = root.querySelectorAll("canvas");
    this.pen = this.over.getContext("2d");
    this.orbit = new Orbit();
    this.view = new View();
    this.labels = new Labels();
    this.frame = { count: 0, poses: new Float32Array(0) };
    this.eye = this.orbit; // from where the picture is seen that stands there,
    this.inMetres = null; // the frame that it shows,
    this.depths = new Float32Array(0);
    this.lengths = new Float32Array(0); // and half of each robot's length there, m
    this.painting = null; // once it was opened
    this.fitted = null; // the rectangle of the world that is fitted, null once somebody has moved the view
    this.mapped = ""; // what the map has fitted last
    this.drawn = {}; // what the meshes were made of
    this.fineness = new Fineness(() => this.repaint());
    button.addEventListener("click", () => this.open(root.hidden));
    new ResizeObserver(() => this.resize()).observe(this.map);
    world.addEventListener("moved", () => this.follow());
    world.addEventListener("fit", () => this.fit());
    world.tools.push({ drawBeside: () => this.draw() });
    this.listen();
    if (kept(KEY, false)) this.open(true);
  }

  open(on) {
    if (!on && this.root.contains(document.activeElement)) this.world.map.focus(); // who worked here goes on there
    this.root.hidden = !on;
    document.body.classList.toggle("spacious", on);
    this.button.setAttribute("aria-pressed", String(on));
    keep(KEY, on);
    if (on && !this.painting) this.load();
    this.world.refit();
  }

  load() {
    this.drawn = {};
    try {
      const ended = (reason, drew) => (reason ? this.fail(reason, drew ? AGAIN : ELSEWHERE) : this.load());
      this.painting = new Painting(this.canvas, (asked, took) => this.show(asked, took), ended);
      this.resize();
    } catch ({ message }) {
      this.fail(message, ELSEWHERE);
    }
  }

  // advice: a sentence.
  fail(reason, advice) {
    this.painting = null;
    this.open(false);
    this.said(`The view in three dimensions cannot be shown: ${reason}. ${advice}`);
  }

  get shown() {
    return !this.root.hidden && this.painting !== null && this.world.frame !== null;
  }

  // ---- the eye

  resize() {
    const { ratio } = this.world;
    const [width, height] = wholePixels(this.map, ratio);
    if (!width || !height) return;
    for (const canvas of [this.canvas, this.over]) showAs(canvas, width, height);
    this.orbit.resize(width, height);
    this.painting?.tell("resize", width, height, ratio);
    [this.over.width, this.over.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.view.resize(width, height);
    this.view.scale = this.view.whole = 1;
    this.view.centre(width / 2, -height / 2);
    if (this.fitted) this.orbit.fit(this.fitted, this.top);
    this.draw();
  }

  // The height of the highest robot, m.
  get top() {
    const { heights, poses } = this.world.frame ?? {};
    return heights ? heights.reduce((most, z, i) => (Number.isNaN(poses[3 * i + 2]) ? most : Math.max(most, z)), 0) : 0;
  }

  // The map shows something else: what it fits is fitted here as well, and what it follows stays in the middle.
  follow() {
    const { fitted, shown, following, flock, view, marks, frame } = this.world;
    if (fitted && shown.join() !== this.mapped) this.fit();
    if (!following && !flock) return;
    this.fitted = null;
    this.orbit.look(view.x, view.y, following ? (frame.heights?.[marks.chosen] ?? 0) : this.orbit.target[2]);
  }

  fit() {
    this.fitted = this.world.shown ?? this.world.scene.area;
    this.mapped = this.fitted.join();
    this.orbit.fit(this.fitted, this.top);
    this.repaint();
  }

  // Change what is seen, and show it.
  moved(change) {
    this.fitted = null;
    change(this.orbit);
    this.repaint();
  }

  // The same by a key; who does not see it hears where it is seen from.
  step(change) {
    this.moved(change);
    const { world, orbit } = this;
    const [x, y] = orbit.target;
    this.from.textContent = `From the ${orbit.words}, ${heightText(orbit.distance, world.scene.unit)} away from ${world.coordinates(x, y)}`;
  }

  repaint() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.draw());
  }

  // ---- drawing

  // Have a picture drawn of what there is now. Gives a promise that is kept once it is under way, null if nothing is shown.
  draw() {
    this.waiting = false;
    if (!this.shown) return null;
    if (!this.mapped) this.fit();
    const { painting, world } = this;
    const { scene, frame } = world;
    const eye = Orbit.of(this.orbit);
    this.drawStill();
    this.drawTrails();
    painting.tell("look", eye);
    const { count, poses, heights, flags } = frame;
    const crashed = Uint8Array.from(flags, (each) => each & CRASHED);
    const forms = (scene.forms ?? []).map((form, at) => [scene.sizes[at][0], form]);
    painting.tell("setBodies", { count, poses, heights, crashed, forms, sizes: scene.sizes, least: grown(SMALLEST), looks: this.codes() });
    return painting.ask({ scene, frame, eye }, painting.software ? this.fineness.next(this.moves) : 1);
  }

  // A picture stands there, which took so long to draw, ms.
  show({ scene, frame, eye }, took) {
    this.fineness.took(took);
    if (scene !== this.world.scene || this.root.hidden) return; // one of other robots comes
    this.eye = eye;
    this.inMetres = frame;
    if (this.depths.length !== frame.count) {
      this.depths = new Float32Array(frame.count);
      this.frame = { poses: new Float32Array(3 * frame.count) };
    }
    this.frame = { ...frame, poses: this.frame.poses };
    eye.project(frame.poses, frame.heights, this.frame.poses, this.depths);
    this.lengths = eye.lengths(scene.sizes, grown(SMALLEST), this.depths);
    this.drawOver();
  }

  // Whether robots or the eye have moved since this was asked last.
  get moves() {
    const { drawn, orbit, world } = this;
    const eye = [...orbit.eye, ...orbit.target].join();
    const still = drawn.poses === world.frame.poses && drawn.eye === eye;
    Object.assign(drawn, { poses: world.frame.poses, eye });
    return !still;
  }

  // Half of each robot's length on the screen, by its index.
  get sizes() {
    return (i) => (this.lengths[i] * this.eye.focus) / (this.depths[i] || Infinity);
  }

  // Ground and walls, where these are others than those that there are.
  drawStill() {
    const { world, drawn, painting } = this;
    const { scene, colours } = world;
    if (drawn.ground !== world.grounds) {
      drawn.ground = world.grounds;
      painting.tell("setGround", scene.area, this.sheet(), colours.ground, world.relief?.map);
    }
    if (drawn.colours !== colours) painting.tell("setInks", this.inks(), parts(colours.bad));
    if (drawn.obstacles === scene.obstacles && drawn.colours === colours) return;
    Object.assign(drawn, { obstacles: scene.obstacles, colours });
    const [left, bottom, right, top] = scene.area;
    const largest = Math.max(...scene.sizes.map(([, radius]) => radius));
    painting.tell("setShadow", dark(colours.area) ? 0.65 : 0.28);
    const tall = scene.tall ?? [];
    const high = Math.max(WALL_RADII * largest, WALL_SHARE * Math.max(right - left, top - bottom), ...new Set(tall));
    painting.tell("setWalls", scene.obstacles, scene.obstacles.map((_, index) => tall[index] ?? high), colours.obstacle);
  }

  // The ground as the map draws it.
  sheet() {
    const { scene, colours, under, relief, field } = this.world;
    const [left, bottom, right, top] = scene.area;
    const scale = SHEET / Math.max(right - left, top - bottom);
    const sheet = new OffscreenCanvas(Math.max(1, (right - left) * scale), Math.max(1, (top - bottom) * scale));
    const view = new View();
    view.resize(sheet.width, sheet.height);
    Object.assign(view, { scale, whole: scale });
    view.centre((left + right) / 2, (bottom + top) / 2);
    drawGround(sheet.getContext("2d"), view, scene, colours, [under, relief, field]);
    return sheet.transferToImageBitmap();
  }

  drawTrails() {
    const { world, drawn, painting } = this;
    const latest = world.shows("trails") ? world.trails.samples[0] : undefined;
    if (drawn.trails === latest?.tick && drawn.palette === world.colours) return;
    Object.assign(drawn, { trails: latest?.tick, palette: world.colours });
    const { corners, colours } = latest
      ? trailLines(world.trails.samples, inksOf(world.looks.bodies), this.colours(), world.scene.area)
      : { corners: new Float32Array(0), colours: new Float32Array(0) };
    painting.tell("setTrails", corners, colours);
  }

  // The palette's colours of robots as red, green and blue of 1.
  colours() {
    return this.world.colours.robots.map(parts);
  }

  // The colour of each look; after those, dimmed ones and that of who is lit.
  inks() {
    const { colours } = this.world;
    const ground = parts(colours.area);
    const robots = this.colours();
    const full = Array.from({ length: LOOKS }, (_, look) => robots[inkOf(look)]);
    const dim = full.map((colour) => colour.map((part, at) => DIMMED * part + (1 - DIMMED) * ground[at]));
    return [...full, ...dim, parts(colours.lit)];
  }

  // For each robot which of these it has.
  codes() {
    const { looks, marks } = this.world;
    if (!marks.lit || marks.glow < 0.5) return looks.bodies;
    return looks.bodies.map((look, i) => (marks.lit[i] === 1 ? 2 * LOOKS : LOOKS + look));
  }

  // What is drawn over the robots: names, rings, what is selected, the label at the pointer.
  drawOver() {
    const { pen, view, world, frame, sizes } = this;
    const { marks, colours, picked, ratio, replies } = world;
    pen.clearRect(0, 0, view.width, view.height);
    const tools = world.tools.filter((tool) => tool.anywhere);
    for (const tool of tools) tool.drawBehind?.(pen, this);
    this.drawDrop();
    drawRings(pen, view, frame, sizes, marks, colours.chosen);
    const flat = (points) => points.map((point) => ({ ...point, ...this.onScreen(point.x, point.y, this.ground(point.x, point.y)) }));
    const scene = { ...world.scene, places: flat(world.scene.places), lights: flat(world.scene.lights), areas: [], tall: [] };
    drawPlaces(pen, view, scene.places, colours);
    this.labels.draw(pen, view, { scene, frame, marks, colours, ratio, sizes, picked, replies, robots: world.shows("names") });
    for (const tool of tools) tool.draw?.(pen, this);
    world.drawTip(this);
  }

  // How high the ground is there, m.
  ground(x, y) {
    return this.world.relief?.at(x, y) ?? 0;
  }

  onScreen(x, y, z) {
    const [seen, depth] = [new Float32Array(3), new Float32Array(1)];
    this.eye.project([x, y, 0], [z], seen, depth);
    return { x: seen[0], y: seen[1] };
  }

  // Add a level circle at the height of the ground in its middle to what is drawn: m.
  addCircle(pen, x, y, radius) {
    const z = this.ground(x, y);
    const [begin, ...others] = this.eye.outline(CIRCLE.map(([c, s]) => [x + c * radius, y + s * radius, z]));
    if (!begin) return;
    pen.moveTo(...begin);
    for (const [px, py] of others) pen.lineTo(px, py);
    pen.closePath();
  }

  // A line from the chosen robot down to the ground, which tells how high it is and over what.
  drawDrop() {
    const { pen, view, world, inMetres: frame } = this;
    const { marks, colours } = world;
    const z = frame.heights?.[marks.chosen] ?? 0;
    if (marks.chosen < 0 || z === 0) return;
    const [x, y] = frame.poses.subarray(3 * marks.chosen);
    const foot = this.onScreen(x, y, this.ground(x, y));
    pen.beginPath();
    pen.moveTo(view.toScreenX(foot.x), view.toScreenY(foot.y));
    pen.lineTo(view.toScreenX(this.frame.poses[3 * marks.chosen]), view.toScreenY(this.frame.poses[3 * marks.chosen + 1]));
    pen.setLineDash([4, 3]);
    pen.strokeStyle = colours.chosen;
    pen.lineWidth = 2; // it covers pixels wholly wherever it lies, else it is faint at some widths of the window
    pen.stroke();
    pen.setLineDash([]);
  }

  // ---- hands and keys

  at(px, py) {
    return this.shown ? robotAt(this.view, this.frame, this.sizes, px, py) : -1;
  }

  listen() {
    const { world } = this;
    const tools = () => (this.shown ? world.tools.filter((tool) => tool.anywhere) : []);
    gestures(this.map, {
      drag: (dx, dy) => this.moved((orbit) => orbit.turn(dx, dy)),
      grab: (x, y, event) => (event.ctrlKey ? this.hold(x, y) : tools().map((tool) => tool.grab?.(x, y, event, this)).find(Boolean)) || null,
      click: (x, y, event) => tools().some((tool) => tool.click?.(x, y, event, this)) || world.choose(this.at(x, y)),
      hover: (x, y, touch) => world.point(x, y, touch, this),
      zoom: (factor, x, y) => this.moved((orbit) => orbit.zoom(factor, x, y)),
      busy: () => tools().some((tool) => tool.busy),
    });
    this.map.addEventListener("keydown", (event) => {
      if (!this.shown || event.metaKey || event.altKey) return;
      if (this.key(event) || this.asOnMap(event)) event.preventDefault();
    });
    world.map.addEventListener("keydown", (event) => {
      if (event.key.toLowerCase() === "v" && !event.ctrlKey && !event.metaKey && !event.altKey) this.open(this.root.hidden);
    });
  }

  // With Ctrl, the ground is taken hold of.
  hold(x, y) {
    let [lastX, lastY] = [x, y];
    const move = (toX, toY) => {
      this.world.letGo();
      this.moved((orbit) => orbit.pan(toX - lastX, toY - lastY));
      [lastX, lastY] = [toX, toY];
    };
    return { move, drop: () => {} };
  }

  // Do what a key means for where one looks from; whether it means anything.
  key(event) {
    const arrow = ARROWS[event.key];
    const { world } = this;
    if (arrow && event.ctrlKey) {
      world.letGo();
      this.step((orbit) => orbit.pan(-TURN_STEP * arrow[0], -TURN_STEP * arrow[1]));
    } else if (event.ctrlKey) return false;
    else if (arrow && event.shiftKey) this.step((orbit) => orbit.turn(-TURN_STEP * arrow[0], -TURN_STEP * arrow[1]));
    else if (arrow) world.choose(robotBeside(this.view, this.frame, world.marks.chosen, arrow));
    else if (event.key === "+" || event.key === "=") this.step((orbit) => orbit.zoom(ZOOM_STEP));
    else if (event.key === "-" || event.key === "_") this.step((orbit) => orbit.zoom(1 / ZOOM_STEP));
    else if ((event.key === "c" || event.key === "C") && !event.shiftKey && world.marks.chosen >= 0) this.centreChosen();
    else return false;
    return true;
  }

  centreChosen() {
    const { frame, marks } = this.world;
    const { poses, heights } = frame;
    this.step((orbit) => orbit.look(poses[3 * marks.chosen], poses[3 * marks.chosen + 1], heights?.[marks.chosen] ?? 0));
  }

  // What else a key means on the map, it means here; whether it means anything.
  asOnMap(event) {
    const { key, shiftKey, ctrlKey } = event;
    return !this.world.map.dispatchEvent(new KeyboardEvent("keydown", { key, shiftKey, ctrlKey, cancelable: true }));
  }
}

// A colour of the page (#rrggbb) as red, green and blue of 1.
const parts = (colour) => [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16) / 255);

const dark = (colour) => parts(colour).reduce((sum, part) => sum + part) < 1.5;
