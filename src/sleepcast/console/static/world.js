// The world pane: three canvases one above the other, and how people move around in them.
//
// Nothing is drawn but in `draw`, at most once for each picture of the screen. The ground is drawn again only when the
// view changes, the trails when there are new ones, the robots with every frame.

import { colourName, CRASHED, decode, EXHAUSTED, FLAG_NAMES } from "./frame.js";
import { Density } from "./density.js";
import { hide, showAs, wholePixels } from "./elements.js";
import { gestures } from "./gestures.js";
import { drawAlternate } from "./alternate.js";
import { drawGround, drawPlaces } from "./ground.js";
import { Labels } from "./labels.js";
import { Pings } from "./pings.js";
import { discsOf, inksOf, looksOf, NONE, palette, sortsOf } from "./shapes.js";
import { drawSwarm, few, robotAt, robotBeside, sizesOf } from "./swarm.js";
import { Trails } from "./trails.js";
import { gridStep, heightText, UNITS, View } from "./view.js";

const ZOOM_STEP = 1.4;
const SMALL = 8; // robots that need less than this part of the world's width and height are shown closer,
const ROOM = 10; // with so many radii of a body around them, so that they may move
const MANY = 20000; // robots in sight beyond which their density is shown unless somebody has chosen otherwise
const FADING = 1500; // ms in which a light goes out
const COVERS = ".zoom, .legend, .field-scale"; // what would hide names
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class World extends EventTarget {
  constructor(root) {
    super();
    this.map = root.querySelector("#map");
    this.tip = root.querySelector("#tip");
    this.placeText = root.querySelector("#place-text");
    this.root = root;
    this.pens = Object.fromEntries(
      ["ground", "trails", "robots"].map((name) => [name, root.querySelector(`#${name}`).getContext("2d")]),
    );
    this.view = new View();
    this.trails = new Trails();
    this.pings = new Pings();
    this.density = new Density();
    this.labels = new Labels();
    this.under = null; // the picture under the grid
    this.relief = null; // how high the ground is, as of relief.js
    this.field = null; // the field there, as of field.js
    this.picked = null; // 1 for each robot that is selected by hand
    this.told = null; // the frame that was last said to be drawn
    this.layers = {}; // whether each is shown, by name, as of layers.js
    this.pointer = null; // the pixel at which the pointer is
    this.pointedOn = this; // where that is: here, or on another view of these robots that has `at`
    this.grounds = 0; // counts what was drawn anew because something else lies there, not because the map was moved
    this.scene = null;
    this.frame = null;
    this.replies = null; // what each robot answered to a question, as of replies.js
    this.alternate = null; // where the robots were in another future
    this.latest = null; // the frame that came last, of this scene or of one that is on its way
    this.lit = null; // who was lit last; of these, `marks` has those whose light is drawn
    this.marks = { lit: null, glow: 1, chosen: -1, pointed: -1 };
    this.following = false; // whether the chosen robot is kept in the middle
    this.flock = null; // robots whose middle is kept there instead
    this.fitted = true;
    this.shown = null; // the rectangle that was fitted last: least x, least y, greatest x, greatest y, m
    this.close = false; // whether only the part of the world is fitted in which robots are
    this.begun = false; // whether there was a frame of this scene
    this.turnover = false; // whether robots come and go, so that some places are empty
    this.colours = palette();
    this.stale = new Set();
    this.waiting = false;
    this.covered = []; // left, top, right, bottom of each thing that lies over the map, in pixels, in turn
    new ResizeObserver(() => this.refit()).observe(this.map);
    const covers = new ResizeObserver(() => this.cover());
    for (const each of [this.map, ...root.querySelectorAll(COVERS)]) covers.observe(each);
    this.tools = []; // what else hands do here, and what else is drawn: {grab, click, busy, draw, drawBehind, drawUnder, drawBeside}, see `listen` and `draw`
    this.coordinates = (x, y) => { // how people read a place
      const { unit } = this.scene;
      return `x ${(x / UNITS[unit]).toFixed(2)}  y ${(y / UNITS[unit]).toFixed(2)} ${unit}`;
    };
    this.listen();
  }

  // ---- what is shown

  // Some of these codes, one for each place: without the places that no robot has in this picture.
  ofRobots(codes) {
    const { poses } = this.frame;
    return this.turnover ? codes.filter((_, place) => !Number.isNaN(poses[3 * place])) : codes;
  }

  setScene(scene) {
    const another = this.scene?.title !== scene.title;
    // On the air, robots come while one looks on, and drive where nobody was before.
    const others = another || this.scene.count !== scene.count;
    const elsewhere = another || this.scene.area.join() !== scene.area.join();
    this.scene = scene;
    this.turnover = scene.names.includes("");
    this.sorts = scene.discs ? discsOf(scene.count) : sortsOf(scene.sizes, scene.count);
    if (others) this.trails = new Trails();
    if (another || this.marks.chosen >= scene.count) this.choose(this.scene.discs ? 0 : -1);
    if (another) this.resize();
    if (another) this.begun = false;
    if (another || ((others || elsewhere) && this.fitted)) this.show(false);
    this.repaint("ground", "trails", "robots");
  }

  // The names of the robots now, where they come and go.
  setNames(names) {
    if (!this.scene) return;
    const others = names.flatMap((name, place) => (name === this.scene.names[place] ? [] : [place]));
    this.scene.names = names;
    this.turnover ||= names.includes("");
    this.trails.forget(others);
    if (others.includes(this.marks.chosen)) this.choose(-1); // it is gone, and another may be in its place
    this.dispatchEvent(new CustomEvent("turnover", { detail: others }));
  }

  // version: of the obstacles, where they may be changed. tall: as in a scene.
  setObstacles(obstacles, version, tall) {
    if (!this.scene) return;
    this.scene.obstacles = obstacles;
    this.scene.version = version;
    this.scene.tall = tall;
    this.repaint("ground");
  }

  // Time has jumped: nobody drove from where the trails end to where the robots are now.
  forgetTrails() {
    this.trails = new Trails();
    this.repaint("trails");
  }

  // Whether the frame is one of this scene; it is drawn then.
  setFrame(buffer) {
    const frame = decode(buffer, this.latest);
    this.latest = frame;
    if (frame.count !== this.scene.count) { // the scene that belongs to it is on its way
      this.dispatchEvent(new CustomEvent("drawn", { detail: { number: frame.number } }));
      return false;
    }
    const still = this.frame?.poses === frame.poses; // nothing has moved: there is nothing to draw
    const passed = this.frame?.tick !== frame.tick;
    this.frame = frame;
    if (still) {
      // Trails of who drives are drawn with the next picture, and nothing is drawn in between.
      if (passed && this.trails.sample(frame, performance.now())) this.repaint("trails");
      this.told = frame;
      this.dispatchEvent(new CustomEvent("drawn", { detail: frame }));
      return true;
    }
    if (this.fitted && (!this.begun || (this.close && !this.view.contains(this.crowd(0))))) this.show(true);
    this.begun = true;
    this.looks = looksOf(this.frame, this.sorts);
    if (this.trails.sample(this.frame, performance.now())) this.repaint("trails");
    this.pings.take(this.frame, performance.now());
    if (this.following && this.marks.chosen >= 0) this.centreChosen();
    if (this.flock) this.centreFlock();
    this.repaint("robots");
    return true;
  }

  // Where the robots were in another future; null for nowhere.
  setAlternate(poses) {
    this.alternate = poses;
    this.repaint("robots");
  }

  // Light these robots, 1 for each of them, null for none. All robots need no light: nothing would stand out. dark:
  // their light has gone out already.
  setLit(lit, dark = false) {
    this.lit = lit;
    const stands = (mark, i) => mark === 0 && !Number.isNaN(this.frame?.poses[3 * i]); // NaN in a row without a robot
    this.marks.lit = !dark && lit?.some(stands) ? lit : null;
    this.marks.glow = 1;
    this.repaint("robots");
  }

  // Let the light go out.
  fade() {
    const { lit } = this.marks;
    const began = performance.now();
    const step = () => {
      if (!lit || this.marks.lit !== lit) return; // others are lit
      this.marks.glow = Math.max(0, 1 - (performance.now() - began) / FADING);
      if (this.marks.glow === 0) this.marks.lit = null;
      this.repaint("robots");
      if (this.marks.lit) requestAnimationFrame(step);
    };
    step();
  }

  choose(index, tell = true) {
    // One is always looked at, and to choose it again forgets nothing of it.
    if (this.scene.discs && (index < 0 || index === this.marks.chosen)) return;
    this.marks.chosen = index;
    if (index < 0) this.following = false;
    this.repaint("robots");
    if (tell) this.dispatchEvent(new CustomEvent("choose", { detail: index }));
  }

  follow(on) {
    this.following = on;
    if (on) this.flock = null;
    if (on) this.centreChosen();
  }

  // Keep the middle of these robots in the middle: a byte for each robot, 1 for those that are followed; null for none.
  followAll(marks) {
    this.flock = marks;
    if (!marks) return;
    this.following = false;
    this.centreFlock();
  }

  recolour() {
    this.colours = palette();
    this.repaint("ground", "trails", "robots");
  }

  // How a robot looks, as `picture` takes it: [body, colours, ring].
  lookOf(index) {
    const { bodies, rings } = this.looks;
    return [bodies[index], this.colours, rings ? rings[index] : NONE];
  }

  // What a robot is, in words: its name, its groups and its colour, then what flags say.
  describe(index) {
    const { scene, frame } = this;
    const words = [scene.names[index]];
    if (!frame) return words[0];
    for (const codes of [frame.second, frame.groups]) {
      const group = codes && scene.groups?.[codes[index] - 1];
      if (group) words.push(group.name);
    }
    if (frame.heights) words.push(`${heightText(frame.heights[index], scene.unit)} up`);
    if (frame.colours?.[index]) words.push(colourName(frame.colours[index]));
    FLAG_NAMES.forEach((name, bit) => {
      if (this.frame.flags[index] & (1 << bit)) words.push(name);
    });
    if (this.frame.flags[index] & CRASHED) words.push("crashed");
    if (this.frame.flags[index] & EXHAUSTED) words.push(`no ${this.scene.supplies.join(" or ")} left`);
    const answer = this.replies?.of(index);
    if (answer) words.push(`answered ${answer}`);
    return words.join(" · ");
  }

  // ---- the view

  // The pane has another size. An empty canvas would flicker, so all is drawn at once.
  resize() {
    this.ratio = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = wholePixels(this.map, this.ratio);
    for (const pen of Object.values(this.pens)) {
      pen.canvas.width = Math.round(width * this.ratio);
      pen.canvas.height = Math.round(height * this.ratio);
      showAs(pen.canvas, width, height);
      pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    }
    this.view.resize(width, height);
    this.schedule("ground", "trails", "robots");
  }

  // Show the robots if they are together in a small part of the world, and the second time all of the world.
  fit() {
    this.following = false;
    this.flock = null;
    if (!this.scene) return;
    this.show(!(this.fitted && this.close));
    this.dispatchEvent(new Event("fit"));
  }

  // close: only the part in which robots are, if it is small.
  show(close) {
    const { area } = this.scene;
    const walls = this.scene.discs && this.scene.obstacles.length;
    const part = close && this.frame?.count ? this.crowd((walls ? 2 : ROOM) * this.scene.sizes[0][1]) : area;
    const small = SMALL * (part[2] - part[0]) < area[2] - area[0] && SMALL * (part[3] - part[1]) < area[3] - area[1];
    this.close = close && (small || this.scene.discs);
    this.shown = this.close ? part : area;
    this.view.fit(area, this.shown);
    this.moved(true);
  }

  // The rectangle in which robots, their ways, places and lights are (and what is solid for Nomads), and so much room around it
  // (m).
  crowd(room) {
    const { poses, count } = this.frame;
    const named = [...this.scene.places, ...this.scene.lights];
    const box = [Infinity, Infinity, -Infinity, -Infinity];
    const take = (x, y) => {
      box[0] = Math.min(box[0], x);
      box[1] = Math.min(box[1], y);
      box[2] = Math.max(box[2], x);
      box[3] = Math.max(box[3], y);
    };
    for (let i = 0; i < count; i += 1) take(poses[3 * i], poses[3 * i + 1]);
    for (const place of named) take(place.x, place.y);
    for (const [x, y] of this.scene.areas.filter(({ closed }) => closed === false).flatMap(({ corners }) => corners)) take(x, y);
    if (this.scene.discs) for (const [x, y] of this.scene.obstacles.flat(2)) take(x, y);
    return [box[0] - room, box[1] - room, box[2] + room, box[3] + room];
  }

  // There is another room for it: what was fitted still is, unless somebody has moved the map.
  refit() {
    this.resize();
    if (this.fitted && this.scene) this.show(this.close);
    this.draw();
  }

  // Something over the map has another size, or lies elsewhere.
  cover() {
    const { left, top } = this.map.getBoundingClientRect();
    const boxes = [...this.root.querySelectorAll(COVERS)].map((each) => each.getBoundingClientRect());
    this.covered = boxes.flatMap((box) => (box.width ? [box.left - left, box.top - top, box.right - left, box.bottom - top] : []));
    this.repaint("robots");
  }

  zoom(factor, x, y) {
    this.view.zoom(factor, x, y);
    this.moved();
  }

  // Follow nobody any more.
  letGo() {
    this.following = false;
    this.flock = null;
    this.moved(this.fitted);
  }

  pan(dx, dy) {
    this.following = false;
    this.flock = null;
    this.view.pan(dx, dy);
    this.moved();
  }

  centreChosen() {
    const { chosen } = this.marks;
    if (chosen < 0 || !this.frame) return;
    this.view.centre(this.frame.poses[3 * chosen], this.frame.poses[3 * chosen + 1]);
    this.moved();
  }

  // Show what lies around a point (m); across: metres from the left edge of the map to the right one, as before if it is
  // not given.
  look(x, y, across) {
    if (across) this.view.zoom(this.view.width / across / this.view.scale);
    this.view.centre(x, y);
    this.moved();
  }

  centreFlock() {
    const { poses, count } = this.frame;
    let [x, y, number] = [0, 0, 0];
    for (let i = 0; i < Math.min(count, this.flock.length); i += 1) {
      if (!this.flock[i] || Number.isNaN(poses[3 * i + 2])) continue; // NaN: nobody knows where it is
      x += poses[3 * i];
      y += poses[3 * i + 1];
      number += 1;
    }
    if (!number) return;
    this.view.centre(x / number, y / number);
    this.moved();
  }

  moved(fitted = false) {
    this.fitted = fitted;
    this.schedule("ground", "trails", "robots");
    this.dispatchEvent(new Event("moved"));
  }

  // shown: whether each layer is shown, by name.
  setLayers(shown) {
    this.layers = shown;
    this.repaint("ground", "trails", "robots");
    this.dispatchEvent(new Event("layers"));
  }

  shows(name) {
    return this.layers[name] ?? (name === "density" && this.frame !== null && !few(this.view, this.frame, MANY));
  }

  // ---- drawing

  repaint(...layers) {
    if (layers.includes("ground")) this.grounds += 1;
    this.schedule(...layers);
  }

  schedule(...layers) {
    for (const layer of layers) this.stale.add(layer);
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => this.draw());
  }

  draw() {
    this.waiting = false;
    const { stale, pens, view, scene, frame, colours } = this;
    this.stale = new Set();
    if (!scene) return;
    if (stale.has("ground")) {
      drawGround(pens.ground, view, scene, colours, [this.under, this.relief, this.field]);
      this.drawScale();
    }
    if (!frame) return;
    this.lookUnder();
    const beside = this.tools.map((tool) => tool.drawBeside?.()); // other views first: what draws them works while the map is drawn
    if (stale.has("trails")) {
      pens.trails.clearRect(0, 0, view.width, view.height);
      for (const tool of this.tools) tool.drawUnder?.(pens.trails);
      if (this.shows("trails")) this.trails.draw(pens.trails, view, inksOf(this.looks.bodies), colours.robots, this.scene.area);
    }
    pens.robots.clearRect(0, 0, view.width, view.height);
    if (this.alternate) drawAlternate(pens.robots, view, this.alternate, frame.poses);
    for (const tool of this.tools) tool.drawBehind?.(pens.robots);
    drawSwarm(pens.robots, view, scene, frame, this.looks, this.marks, colours, this.ratio);
    if (this.shows("density")) this.density.draw(pens.robots, view, frame, colours.density, performance.now());
    drawPlaces(pens.robots, view, scene.places, colours);
    const { marks, picked, ratio, sizes, covered } = this;
    this.labels.draw(pens.robots, view, { scene, frame, marks, colours, ratio, sizes, picked, covered, replies: this.replies, robots: this.shows("names") });
    for (const tool of this.tools) tool.draw?.(pens.robots);
    this.drawTip();
    if (this.shows("pings") && this.pings.draw(pens.robots, view, frame, sizes, colours, performance.now())) this.repaint("robots");
    if (frame === this.told) return;
    this.told = frame;
    Promise.all(beside).then(() => this.dispatchEvent(new CustomEvent("drawn", { detail: frame })));
  }

  drawScale() {
    const step = gridStep(this.view, this.scene.unit, 140);
    this.root.querySelector("#scale-bar").style.width = `${step.metres * this.view.scale}px`;
    this.root.querySelector("#scale-text").textContent = step.label;
  }

  // ---- finding robots

  // The robot nearest to the pixel within reach, or -1.
  at(px, py) {
    return this.frame ? robotAt(this.view, this.frame, this.sizes, px, py) : -1;
  }

  // The frame that is shown, as it came: in `frame`, another view has robots in pixels.
  get inMetres() {
    return this.frame;
  }

  // Half of each robot's length on the screen, by its index.
  get sizes() {
    return sizesOf(this.view, this.scene);
  }

  // Add a circle that lies on the ground to what is drawn: m.
  addCircle(pen, x, y, radius) {
    const [px, py, pixels] = [this.view.toScreenX(x), this.view.toScreenY(y), radius * this.view.scale];
    pen.moveTo(px + pixels, py);
    pen.arc(px, py, pixels, 0, 2 * Math.PI);
  }

  // The robot next to the chosen one in a direction of the screen; the one nearest to the middle if none is chosen.
  next(direction) {
    return robotBeside(this.view, this.frame, this.marks.chosen, direction);
  }

  keepInSight(index) {
    const x = this.view.toScreenX(this.frame.poses[3 * index]);
    const y = this.view.toScreenY(this.frame.poses[3 * index + 1]);
    if (x < 20 || y < 20 || x > this.view.width - 20 || y > this.view.height - 20) this.centreChosen();
  }

  // ---- pointer and keys

  listen() {
    gestures(this.map, {
      drag: (dx, dy) => this.pan(dx, dy),
      // A tool may take hold of the map, or want a click for itself.
      grab: (x, y, event) => (this.frame && this.tools.map((tool) => tool.grab?.(x, y, event)).find(Boolean)) || null,
      click: (x, y, event) => this.tools.some((tool) => tool.click?.(x, y, event)) || this.choose(this.at(x, y)),
      hover: (x, y, touch) => this.point(x, y, touch),
      zoom: (factor, x, y) => this.zoom(factor, x, y),
      busy: () => this.tools.some((tool) => tool.busy),
    });
    this.map.addEventListener("keydown", (event) => {
      if (this.frame && !event.ctrlKey && !event.metaKey && !event.altKey && this.key(event)) event.preventDefault();
    });
  }

  // The pointer is over the pixel, or gone: show what is there. What a finger has touched stays told. on: as `pointedOn`.
  point(px, py, touch = false, on = this) {
    if (!this.scene || !this.frame) return;
    this.pointer = px === null ? null : [px, py];
    this.pointedOn = on;
    if (this.pointer && on === this) {
      this.placeText.textContent = this.coordinates(...this.view.toWorld(px, py));
    } else if (!touch) this.placeText.textContent = "";
    this.lookUnder();
    this.drawTip();
  }

  // Which robot is at the pointer; it may have come there by itself.
  lookUnder() {
    const pointed = this.pointer ? this.pointedOn.at(...this.pointer) : -1;
    if (pointed === this.marks.pointed) return;
    this.marks.pointed = pointed;
    this.map.classList.toggle("pointing", pointed >= 0);
    this.repaint("robots");
  }

  // The label of the robot at the pointer, beside the robot wherever a view shows it. on: the view whose label it is.
  drawTip(on = this) {
    const { pointed } = this.marks;
    const { tip, view, frame } = on;
    const there = this.pointedOn === on && pointed >= 0 && pointed < frame.count;
    hide(tip, !there);
    if (!there) return;
    tip.textContent = this.describe(pointed);
    const x = view.toScreenX(frame.poses[3 * pointed]);
    const y = view.toScreenY(frame.poses[3 * pointed + 1]);
    tip.style.transform = `translate(${Math.max(0, Math.min(x + 16, view.width - tip.offsetWidth - 4))}px, ${y + 16}px)`;
  }

  // Do what a key on the map means; whether it means anything.
  key(event) {
    const arrow = ARROWS[event.key];
    if (arrow && event.shiftKey) this.pan(-60 * arrow[0], -60 * arrow[1]);
    else if (arrow) {
      this.choose(this.next(arrow));
      if (this.marks.chosen >= 0) this.keepInSight(this.marks.chosen);
    } else if (event.key === "+" || event.key === "=") this.zoom(ZOOM_STEP);
    else if (event.key === "-" || event.key === "_") this.zoom(1 / ZOOM_STEP);
    else if (event.key === "f" || event.key === "F") this.fit();
    else if (event.key === "c" || event.key === "C") event.shiftKey ? this.dispatchEvent(new Event("follow")) : this.centreChosen();
    else if (event.key === "t" || event.key === "T") this.dispatchEvent(new Event("trails"));
    else if (event.key === "Escape") this.choose(-1);
    else return false;
    return true;
  }
}
