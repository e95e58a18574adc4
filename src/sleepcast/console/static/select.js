// Robots that are selected by hand: with a lasso (L, or Shift while dragging), by Shift and a click, with Space, or all
// that are highlighted. The desk finds the shortest test that holds for exactly these, and one press puts it into the
// prompt.

import { encloses } from "./polygon.js";
import { few, MAX_SHAPES } from "./swarm.js";
import { Refusal } from "./wire.js";

const PAUSE = 150; // ms: several robots may be clicked one after the other
const PATIENCE = 30000; // ms for which the search may take: it goes on beside the rest
const APART = 3; // pixels between two corners of a lasso

export class Selecting extends EventTarget {
  // bar: the element that tells what is selected. button: switches the lasso. undo: as of undo.js.
  constructor(world, wire, bar, button, undo) {
    super();
    this.undo = undo;
    this.world = world;
    this.wire = wire;
    this.bar = bar;
    this.button = button;
    this.find = (name) => bar.querySelector(`.${name}`);
    this.on = false; // whether a drag draws a lasso instead of moving the map
    this.marks = new Uint8Array(0); // 1 for each robot that is selected
    this.count = 0;
    this.corners = []; // of the lasso that is being drawn, x and y in pixels in turn
    this.lassoOn = null; // where it is drawn
    this.asked = 0;
    this.anywhere = true; // on other views of these robots too, each a `surface` {view, frame, sizes, at}
    this.time = 0; // how often robots have come or gone
    this.changedAt = new Map(); // when that last happened at a place
    world.tools.push(this);
    button.addEventListener("click", () => this.switch(!this.on));
    this.find("use").addEventListener("click", () => this.use());
    this.find("clear").addEventListener("click", () => this.clear());
    world.map.addEventListener("keydown", (event) => {
      if (!event.ctrlKey && !event.metaKey && !event.altKey && this.key(event)) event.preventDefault();
    });
  }

  // In a recording there is no prompt: the test is copied.
  setCopies(copies) {
    this.find("use").textContent = copies ? "Copy test" : "Use test";
    this.find("use").title = copies ? "Copy this test" : "Put this test into the prompt";
  }

  switch(on) {
    this.on = on;
    this.button.setAttribute("aria-pressed", String(on));
    this.world.map.classList.toggle("lassoing", on);
  }

  key(event) {
    const { chosen } = this.world.marks;
    if (event.key === "l" || event.key === "L") this.switch(!this.on);
    else if (event.key === " " && chosen >= 0) this.toggle(chosen);
    else if (event.key === "Escape" && this.on) this.switch(false);
    else if (event.key === "Escape" && this.count) this.clear();
    else return false;
    return true;
  }

  // ---- what is selected

  // Select these robots: 1 for each. pause: ms without another change before their test is asked for.
  set(marks, pause = PAUSE) {
    const before = this.marks;
    this.put(marks, pause);
    const after = this.marks;
    if (before.length === after.length && before.every((mark, index) => mark === after[index])) return;
    const name = this.count ? `select ${this.count.toLocaleString("en")} ${this.count === 1 ? "robot" : "robots"}` : "clear the selection";
    const { time } = this;
    const again = (marks) => this.put(marks.map((mark, place) => (this.changedAt.get(place) > time ? 0 : mark)));
    this.undo.did(name, () => again(before), () => again(after));
  }

  put(marks, pause = PAUSE) {
    this.marks = Uint8Array.from(marks, (mark) => (mark ? 1 : 0));
    this.changed(pause);
  }

  clear() {
    this.set(new Uint8Array(0));
  }

  // Other robots are at these places than before, which nobody has selected. It cannot be undone, and nothing that is
  // undone selects them.
  forget(places) {
    this.time += 1;
    for (const place of places) this.changedAt.set(place, this.time);
    const gone = places.filter((place) => this.marks[place]);
    if (gone.length) this.put(this.marks.map((mark, place) => (gone.includes(place) ? 0 : mark)));
  }

  toggle(index) {
    const marks = this.padded();
    marks[index] = marks[index] ? 0 : 1;
    this.set(marks);
  }

  // The marks for all robots of the picture.
  padded() {
    const marks = new Uint8Array(this.world.frame.count);
    marks.set(this.marks.subarray(0, marks.length));
    return marks;
  }

  changed(pause) {
    this.count = this.marks.reduce((sum, mark) => sum + mark, 0);
    this.bar.hidden = this.count === 0;
    this.find("count").textContent = `${this.count.toLocaleString("en")} selected`;
    this.show([], "", this.count ? "Looking for a test …" : "");
    this.world.repaint("robots");
    clearTimeout(this.timer);
    if (this.count) this.timer = setTimeout(() => this.ask(), pause);
    this.dispatchEvent(new CustomEvent("change", { detail: this.count }));
  }

  // ---- the test for them

  // Ask for the test as robots are now; gives the tests.
  async ask() {
    const number = (this.asked += 1);
    try {
      const answer = await this.wire.ask("pick", { marks: packed(this.padded()) }, PATIENCE);
      if (number === this.asked && this.count) this.show(answer.tests, answer.listed, answer.sentence);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      if (number === this.asked) this.show([], "", refusal.message);
    }
  }

  show(tests, listed, sentence) {
    const choices = tests.map((test) => [test, test]);
    if (listed && !tests.includes(listed)) choices.push([listed, "each by its number"]);
    const chooser = this.find("tests");
    chooser.replaceChildren(...choices.map(([test, text]) => new Option(text, test)));
    chooser.hidden = choices.length === 0;
    chooser.title = choices.length > 1 ? "The shortest test is first; there are others" : tests[0] ?? "";
    this.find("use").hidden = choices.length === 0;
    this.find("said").textContent = sentence;
    this.find("said").hidden = !sentence;
  }

  // Put the test into the prompt. Robots have moved since it was found, so the shortest is looked for once more.
  async use() {
    const chooser = this.find("tests");
    if (chooser.selectedIndex === 0) await this.ask();
    if (chooser.value) this.dispatchEvent(new CustomEvent("use", { detail: chooser.value }));
  }

  // ---- on the map

  grab(x, y, event, surface = this.world) {
    if (!this.on && !event.shiftKey) return null;
    const adds = event.shiftKey;
    this.corners = [x, y];
    this.lassoOn = surface;
    return {
      move: (toX, toY) => {
        const [lastX, lastY] = this.corners.slice(-2);
        if (Math.hypot(toX - lastX, toY - lastY) < APART) return;
        this.corners.push(toX, toY);
        this.world.repaint("robots");
      },
      drop: (moved) => {
        if (moved) this.take(adds, surface);
        this.corners = [];
        this.world.repaint("robots");
      },
    };
  }

  click(x, y, event, surface = this.world) {
    if (!this.on && !event.shiftKey) return false;
    const index = surface.at(x, y);
    if (index >= 0) this.toggle(index);
    return true;
  }

  // Select what the lasso encloses.
  take(adds, { view, frame }) {
    const marks = adds ? this.padded() : new Uint8Array(frame.count);
    for (let i = 0; i < frame.count; i += 1) {
      const x = view.toScreenX(frame.poses[3 * i]);
      const y = view.toScreenY(frame.poses[3 * i + 1]);
      if (encloses(this.corners, x, y)) marks[i] = 1;
    }
    this.set(marks);
  }

  draw(pen, surface = this.world) {
    const { view, frame, sizes } = surface;
    const colour = this.world.colours.chosen;
    if (this.count) {
      const points = !few(view, frame, MAX_SHAPES);
      const frames = new Path2D();
      for (let i = 0; i < Math.min(frame.count, this.marks.length); i += 1) {
        if (!this.marks[i]) continue;
        const x = view.toScreenX(frame.poses[3 * i]);
        const y = view.toScreenY(frame.poses[3 * i + 1]);
        if (x < -20 || y < -20 || x > view.width + 20 || y > view.height + 20) continue;
        if (points) frames.rect(x - 1.5, y - 1.5, 3, 3);
        else corners(frames, x, y, sizes(i) + 4);
      }
      pen.fillStyle = pen.strokeStyle = colour;
      pen.lineWidth = 1.8;
      if (points) pen.fill(frames);
      else pen.stroke(frames);
    }
    if (this.lassoOn !== surface || this.corners.length < 4) return;
    pen.beginPath();
    for (let at = 0; at < this.corners.length; at += 2) pen.lineTo(this.corners[at], this.corners[at + 1]);
    pen.closePath();
    pen.fillStyle = pen.strokeStyle = colour;
    pen.globalAlpha = 0.12;
    pen.fill();
    pen.globalAlpha = 1;
    pen.lineWidth = 1.5;
    pen.setLineDash([5, 4]);
    pen.stroke();
    pen.setLineDash([]);
  }
}

// The four corners of a square round a point: a shape that nothing else on the map has.
function corners(path, x, y, half) {
  const arm = half * 0.55;
  for (const [right, down] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
    path.moveTo(x + right * half, y + down * (half - arm));
    path.lineTo(x + right * half, y + down * half);
    path.lineTo(x + right * (half - arm), y + down * half);
  }
}

// Marks as the desk reads them: a bit for each robot, in base 64.
export function packed(marks) {
  const bytes = new Uint8Array(Math.ceil(marks.length / 8));
  marks.forEach((mark, index) => {
    if (mark) bytes[index >> 3] |= 1 << (index & 7);
  });
  let text = "";
  for (let at = 0; at < bytes.length; at += 4096) text += String.fromCharCode(...bytes.subarray(at, at + 4096));
  return btoa(text);
}
