// A field of the world as a layer of the map, under everything else, with its scale. A field that grows is asked for again as
// time passes, and whatever the page looks at: now, a moment of the past, a recording.

import { bytes, clock } from "./accounting.js";
import { make, write } from "./elements.js";
import { keep, kept } from "./kept.js";
import { Refusal } from "./wire.js";

const KEY = "field";
const AGAIN = 500; // ms between an answer and the next question
const REFUSED = 3000; // ms until it is asked once more after a refusal: a recording may still be run again
const PATIENCE = 60000; // ms: a moment of the past may have to be run again
const STEPS = 5; // colours of the scale, from the least to the greatest (style.css)
const APART = 40; // pixels between two arrows
const ARROW = 15; // pixels of the longest one

export class FieldLayer {
  // root: the element of the scale. menu: that of the layers. past: whether the page shows another time than now.
  constructor(world, wire, root, menu, past) {
    this.world = world;
    this.wire = wire;
    this.find = (name) => root.querySelector(`.${name}`);
    this.root = root;
    this.menu = menu;
    this.past = past;
    this.fields = []; // of the scene: {name, about, grows}
    this.choice = make("select", { className: "field-choice", title: "Which field" });
    this.choice.setAttribute("aria-label", "Which field");
    this.choice.addEventListener("change", () => this.choose(this.choice.value));
    world.field = this;
    world.addEventListener("layers", () => this.show());
    this.forget();
  }

  forget() {
    this.sheet = null; // a pixel for each cell
    this.known = null; // {field, tick, picture} as the desk told it
    this.refusal = "";
    this.asked = null; // {name, tick} of the last question
    this.next = 0;
  }

  setScene({ fields }) {
    const told = JSON.stringify(fields);
    this.asked = null; // fields of these names may be others: the desk may have begun again
    if (told === this.told) return;
    this.told = told;
    this.fields = fields;
    this.choice.replaceChildren(...fields.map(({ name }) => new Option(name, name)));
    this.choice.hidden = fields.length < 2;
    const line = this.menu.querySelector("#layer-field")?.closest(".layer");
    line?.append(this.choice);
    if (line) line.hidden = !fields.length;
    const before = kept(KEY, "");
    this.choose(fields.some(({ name }) => name === before) ? before : (fields[0]?.name ?? ""), false);
  }

  choose(name, byHand = true) {
    if (byHand) keep(KEY, name);
    this.name = this.choice.value = name;
    this.forget();
    this.show();
  }

  // The page looks at another time from now on: what was answered until now may be of any.
  jump() {
    this.asked = null;
  }

  get shown() {
    return this.fields.length > 0 && this.world.shows("field");
  }

  get field() {
    return this.fields.find(({ name }) => name === this.name);
  }

  show() {
    this.root.hidden = !this.shown;
    this.tell();
    this.world.repaint("ground");
    this.ask();
  }

  // Ask again if anything may have changed since the last answer; called with every picture.
  async ask() {
    const { frame } = this.world;
    if (!this.shown || !frame || this.waiting) return; // one question at a time
    const known = this.asked?.name === this.name;
    const same = !this.refusal && this.asked?.tick === frame.tick;
    if (performance.now() < this.next || (known && (!(this.field.grows || this.refusal) || same))) return;
    this.asked = { name: this.name, tick: frame.tick };
    this.waiting = true;
    try {
      this.take(await this.wire.ask("field", { name: this.name }, PATIENCE));
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.refuse(refusal.message);
    } finally {
      this.waiting = false;
      const rest = this.refusal ? REFUSED : AGAIN;
      this.next = performance.now() + rest;
      setTimeout(() => this.ask(), rest); // the last picture before time stands still counts, too
    }
  }

  take(answer) {
    if (answer.field !== this.name) return; // somebody chose another one meanwhile
    this.known = answer;
    this.refusal = "";
    this.paint();
    this.tell();
  }

  refuse(reason) {
    this.known = this.sheet = null;
    this.refusal = reason;
    this.tell();
    this.world.repaint("ground");
  }

  recolour() {
    if (this.known) this.paint();
  }

  // The cells as pixels, the top row first.
  paint() {
    const { columns, rows, cells } = this.known.picture;
    const [values, inks] = [bytes(cells), ramp(this.world.colours.field)];
    const image = new ImageData(columns, rows);
    const pixels = new Uint32Array(image.data.buffer);
    for (let row = 0; row < rows; row += 1) {
      const from = (rows - 1 - row) * columns;
      for (let column = 0; column < columns; column += 1) pixels[row * columns + column] = inks[values[from + column]];
    }
    this.sheet = new OffscreenCanvas(columns, rows);
    this.sheet.getContext("2d").putImageData(image, 0, 0);
    this.angles = this.known.picture.angles ? bytes(this.known.picture.angles) : null;
    this.values = values;
    this.world.repaint("ground");
  }

  // What the scale says.
  tell() {
    const [low, middle, high] = this.known?.picture.scale ?? ["", "", ""];
    write(this.find("name"), this.name);
    this.root.title = this.field?.about ?? "";
    for (const [name, text] of Object.entries({ low, middle, high })) write(this.find(name), text);
    this.find("values").hidden = !this.known;
    const { frame } = this.world;
    const late = this.known && this.field.grows && this.past() && frame && this.known.tick !== frame.tick;
    const at = late && frame.tick ? `as it was at ${clock((this.known.tick * frame.time) / frame.tick)}` : "";
    write(this.find("told"), this.refusal || at);
    this.find("told").hidden = !(this.refusal || at);
  }

  draw(pen, view) {
    if (!this.sheet || !this.shown) return;
    const [left, bottom, right, top] = this.world.scene.area;
    const place = [view.toScreenX(left), view.toScreenY(top), (right - left) * view.scale, (top - bottom) * view.scale];
    pen.save();
    pen.globalAlpha = this.world.under?.image && this.world.shows("picture") ? 0.7 : 1; // the picture is seen through it
    pen.imageSmoothingEnabled = !this.field.grows; // what grows lives in cells
    pen.drawImage(this.sheet, ...place);
    pen.restore();
    if (this.angles) this.drawArrows(pen, view, place);
  }

  // Where vectors point, and how long they are beside the longest.
  drawArrows(pen, view, [left, top, width, height]) {
    const { columns, rows } = this.known.picture;
    pen.beginPath();
    for (let y = top + APART / 2; y < top + height; y += APART) {
      for (let x = left + APART / 2; x < left + width; x += APART) {
        if (x < 0 || y < 0 || x > view.width || y > view.height) continue;
        const column = Math.floor(((x - left) / width) * columns);
        const at = (rows - 1 - Math.floor(((y - top) / height) * rows)) * columns + column;
        arrow(pen, x, y, (-this.angles[at] * Math.PI) / 128, (ARROW * this.values[at]) / 255);
      }
    }
    pen.strokeStyle = this.world.colours.quiet;
    pen.lineWidth = 1.2;
    pen.stroke();
  }
}

function arrow(pen, x, y, angle, length) {
  if (length < 1) return;
  const [c, s] = [Math.cos(angle) * length, Math.sin(angle) * length];
  pen.moveTo(x - c, y - s);
  pen.lineTo(x + c, y + s);
  for (const side of [-1, 1]) {
    pen.moveTo(x + c, y + s);
    pen.lineTo(x + 0.4 * c - side * 0.4 * s, y + 0.4 * s + side * 0.4 * c);
  }
}

// The colour of each of 256 steps of the scale, as a number in the order of an image's bytes.
function ramp(colours) {
  return Uint32Array.from({ length: 256 }, (_, step) => {
    const [red, green, blue] = between(colours, step / 255);
    return (255 << 24) | (blue << 16) | (green << 8) | red;
  });
}

// The colour of a scale (its steps as #rrggbb) at a place from 0 to 1: red, green and blue, of 255.
export function between(colours, part) {
  const place = part * (STEPS - 1);
  const first = Math.min(STEPS - 2, Math.floor(place));
  const [from, to] = [colours[first], colours[first + 1]].map((colour) => [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16)));
  return from.map((value, channel) => Math.round(value + (place - first) * (to[channel] - value)));
}
