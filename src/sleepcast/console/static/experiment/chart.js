// The chart: curves with their bands, drawn as SVG. Marks are buttons: they can be reached with Tab and chosen with
// Enter, and they stay the same elements while curves grow, so that the focus stays where it is.

import { element, short, ticks } from "../scales.js";

const COLOURS = 8; // --curve-0 to --curve-7
const LABEL = 7; // pixels of one letter of a tick, about
const LEFT = 64;
const RIGHT = 22;
const TOP = 16;
const BOTTOM = 56;
const SHAPES = [
  "M-4 0a4 4 0 1 0 8 0a4 4 0 1 0-8 0z",
  "M-3.6-3.6h7.2v7.2h-7.2z",
  "M0-5.2l5.2 5.2l-5.2 5.2l-5.2-5.2z",
  "M0-5l5 8.6h-10z",
  "M0 5l5-8.6h-10z",
  "M-1.5-5h3v3.5h3.5v3h-3.5v3.5h-3v-3.5h-3.5v-3h3.5z",
  "M-5 0l8.6-5v10z",
  "M5 0l-8.6-5v10z",
];

export const colour = (index) => `var(--curve-${index % COLOURS})`;

// The mark of the curve of this number, as it stands in the legend.
export function sign(index) {
  const line = element("path", { d: "M-13 0h26", "stroke-width": 2 });
  line.style.stroke = colour(index);
  const shape = element("path", { d: SHAPES[index % SHAPES.length] });
  shape.style.fill = colour(index);
  return element("svg", { viewBox: "-13 -7 26 14", "aria-hidden": "true" }, line, shape);
}

export class Chart extends EventTarget {
  constructor(root, tip) {
    super();
    this.root = root;
    this.tip = tip;
    this.drawing = null;
    this.marks = new Map(); // by curve and place
    this.chosen = "";
    this.ground = element("g", { "aria-hidden": "true" });
    this.lines = element("g", { "aria-hidden": "true" });
    this.buttons = element("g", { role: "group", "aria-label": "Points" });
    this.svg = element("svg", { role: "group", "aria-label": "Curves" }, this.ground, this.lines, this.buttons);
    root.prepend(this.svg);
    new ResizeObserver(() => this.draw()).observe(root);
  }

  // drawing: {x, y, by, found: {curves, unit, ticks, joined}}, as the server says it.
  show(drawing) {
    this.drawing = drawing;
    this.draw();
  }

  choose(key) {
    this.chosen = key;
    for (const [each, mark] of this.marks) mark.button.setAttribute("aria-pressed", String(each === key));
  }

  draw() {
    if (!this.drawing) return;
    const { width, height } = this.root.getBoundingClientRect();
    const { found } = this.drawing;
    const all = found.curves.flatMap((curve) => curve.marks);
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.scale(all, width, height);
    this.ground.replaceChildren(...(all.length ? this.axes(width, height) : []));
    this.lines.replaceChildren(...found.curves.flatMap((curve, index) => this.curve(curve, index)));
    const there = new Set();
    found.curves.forEach((curve, index) => {
      for (const mark of curve.marks) there.add(this.place(curve, index, mark));
    });
    for (const [key, mark] of this.marks) {
      if (there.has(key)) continue;
      mark.button.remove();
      this.marks.delete(key);
    }
  }

  // Map values onto pixels.
  scale(all, width, height) {
    const places = all.map((mark) => mark.at);
    const named = this.drawing.found.ticks.length;
    const left = named ? -0.5 : Math.min(...places);
    const right = named ? named - 0.5 : Math.max(...places);
    const across = right - left || 1;
    const low = Math.min(...all.map((mark) => mark.low));
    const high = Math.max(...all.map((mark) => mark.high));
    const margin = (high - low || Math.abs(high) || 1) * 0.06;
    this.ends = [left - (right > left ? 0 : 0.5), left + across - (right > left ? 0 : 0.5), low - margin, high + margin];
    const [from, to, bottom, top] = this.ends;
    this.toX = (value) => LEFT + 8 + ((value - from) / (to - from)) * (width - LEFT - RIGHT - 16);
    this.toY = (value) => height - BOTTOM - ((value - bottom) / (top - bottom)) * (height - BOTTOM - TOP);
  }

  axes(width, height) {
    const { x, y, found } = this.drawing;
    const [from, to, bottom, top] = this.ends;
    const drawn = [];
    const text = (words, attributes) => drawn.push(element("text", attributes, words));
    for (const value of ticks(bottom, top, Math.max(2, (height - TOP - BOTTOM) / 60))) {
      const up = this.toY(value);
      drawn.push(element("path", { class: "grid", d: `M${LEFT} ${up}H${width - RIGHT}` }));
      text(short(value), { x: LEFT - 8, y: up + 4, "text-anchor": "end" });
    }
    const room = width - LEFT - RIGHT;
    const names = found.ticks.map((name, index) => [index, name]);
    const shown = names.length ? names : ticks(from, to, Math.max(2, room / 90)).map((value) => [value, short(value)]);
    const most = Math.max(4, Math.floor(room / shown.length / LABEL));
    const every = names.length ? Math.ceil(4 / Math.max(1, room / shown.length / LABEL)) : 1;
    shown.forEach(([value, name], index) => {
      const along = this.toX(value);
      drawn.push(element("path", { class: "grid", d: `M${along} ${TOP}V${height - BOTTOM}` }));
      const label = names.length && name.length > most * every ? `${name.slice(0, most * every - 1)}…` : name;
      if (index % every === 0) text(label, { x: along, y: height - BOTTOM + 18, "text-anchor": "middle" });
    });
    drawn.push(element("path", { class: "edge", d: `M${LEFT} ${TOP}V${height - BOTTOM}H${width - RIGHT}` }));
    const middle = LEFT + room / 2;
    text(found.unit ? `${x} (${found.unit})` : x, { class: "name", x: middle, y: height - 12, "text-anchor": "middle" });
    const centre = TOP + (height - TOP - BOTTOM) / 2;
    text(y, { class: "name", x: 0, y: 0, transform: `translate(16 ${centre}) rotate(-90)`, "text-anchor": "middle" });
    return drawn;
  }

  curve({ marks }, index) {
    if (!marks.length) return [];
    const at = (value, height) => `${this.toX(value).toFixed(2)} ${this.toY(height).toFixed(2)}`;
    if (!this.drawing.found.joined) {
      const whiskers = marks.map(({ at: place, low, high }) => `M${at(place, low)}L${at(place, high)}`).join("");
      const drawn = element("path", { class: "whisker", d: whiskers });
      drawn.style.stroke = colour(index);
      return [drawn];
    }
    const upper = marks.map((mark) => at(mark.at, mark.high));
    const lower = marks.map((mark) => at(mark.at, mark.low)).reverse();
    const band = element("path", { class: "band", d: `M${[...upper, ...lower].join("L")}z` });
    band.style.fill = colour(index);
    const line = element("path", { class: "line", d: `M${marks.map((mark) => at(mark.at, mark.mean)).join("L")}` });
    line.style.stroke = colour(index);
    return [band, line];
  }

  // Put the button of a mark where it belongs; gives its key.
  place(curve, index, mark) {
    const key = JSON.stringify([curve.name, mark.x]);
    let known = this.marks.get(key);
    if (!known) {
      const shape = element("path", { d: SHAPES[index % SHAPES.length] });
      const rings = [element("circle", { class: "hit", r: 11 }), shape, element("circle", { class: "ring", r: 8 })];
      const button = element("g", { class: "mark", role: "button", tabindex: 0, "aria-pressed": key === this.chosen }, ...rings);
      known = { button, shape };
      this.marks.set(key, known);
      const choose = () => this.dispatchEvent(new CustomEvent("choose", { detail: known.detail }));
      button.addEventListener("click", choose);
      button.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        choose();
      });
      for (const on of ["pointerenter", "focus"]) button.addEventListener(on, () => this.tell(known));
      for (const off of ["pointerleave", "blur"]) button.addEventListener(off, () => { this.tip.hidden = true; });
      this.buttons.append(button);
    }
    known.detail = { key, name: curve.name, mark };
    known.shape.style.fill = colour(index);
    known.shape.setAttribute("d", SHAPES[index % SHAPES.length]);
    known.button.setAttribute("transform", `translate(${this.toX(mark.at)} ${this.toY(mark.mean)})`);
    known.button.setAttribute("aria-label", this.words(known.detail));
    return key;
  }

  // What a mark is, in words.
  words({ name, mark }) {
    const { x, y, by, found } = this.drawing;
    const unit = found.unit && !mark.x.endsWith(found.unit) ? ` ${found.unit}` : "";
    const of = by ? `${by} = ${name}, ` : "";
    const runs = mark.runs === 1 ? "1 run" : `${mark.runs} runs`;
    return `${of}${x} = ${mark.x}${unit}: ${y} ${short(mark.mean)} (${short(mark.low)} to ${short(mark.high)}), ${runs}`;
  }

  tell({ detail }) {
    const { width } = this.root.getBoundingClientRect();
    this.tip.textContent = this.words(detail);
    this.tip.hidden = false;
    const left = Math.min(this.toX(detail.mark.at) + 12, width - this.tip.offsetWidth - 4);
    this.tip.style.translate = `${Math.max(4, left)}px ${Math.max(4, this.toY(detail.mark.mean) - 38)}px`;
  }
}
