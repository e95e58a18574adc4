// Plots: the desk says which there are and samples them; each is a card with a chart (uPlot), and can be taken along as
// an image or as numbers. Nothing is asked for while the pane is closed.

import { clock } from "./accounting.js";
import { make, write } from "./elements.js";
import { ExpressionField } from "./expression.js";
import { figure, namesOf, numbers } from "./figure.js";
import { EARLIER, alongside, atOrBefore, partingOf } from "./futures.js";
import { download, fileName } from "./files.js";
import { short } from "./scales.js";
import { Refusal } from "./wire.js";

const AGAIN = 1000; // ms between two looks at a plot
const SOON = 50; // ms until the rest of an answer is asked for
const HEIGHTS = [110, 300]; // pixels of a chart: at least, at most
const AROUND = 112; // pixels of the pane above and below a chart, so that one row of cards fits
const TIMES = [0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 21600, 43200, 86400];

// The colours of the page, for charts.
function inks() {
  const css = getComputedStyle(document.documentElement);
  const colour = (name) => css.getPropertyValue(name).trim();
  const [ink, quiet, grid, ground, line] = ["--ink", "--muted", "--line", "--panel", "--accent"].map(colour);
  return { ink, quiet, grid, ground, line };
}

// One plot: its card, its numbers, and its chart.
export class Card {
  constructor(plot, close) {
    this.plot = plot;
    this.data = [[], ...plot.lines.map(() => [])];
    this.earlier = []; // columns of the future that this run has left
    this.parting = null; // where it did, see `partingOf`
    this.thinned = 0;
    this.chart = null;
    this.element = document.createElement("figure");
    this.element.className = "plot";
    this.head = document.createElement("figcaption");
    this.name = Object.assign(document.createElement("span"), { className: "plot-name", textContent: plot.title, title: plot.title });
    this.head.append(this.name, ...this.buttons(close));
    this.place = Object.assign(document.createElement("div"), { className: "plot-chart" });
    this.parted = make("span");
    this.key = make("p", { className: "plot-key", hidden: true }, make("i"), "this run ", make("i", { className: "earlier" }), `${EARLIER} `, this.parted);
    this.told = Object.assign(document.createElement("p"), { className: "plot-told" });
    this.element.append(this.head, this.place, this.key, this.told);
  }

  buttons(close) {
    const button = (text, title, run) => {
      const made = Object.assign(document.createElement("button"), { type: "button", textContent: text, title });
      made.addEventListener("click", run);
      return made;
    };
    return [
      button("PNG", "Save as an image", () => this.savePng()),
      button("SVG", "Save as a drawing", () => this.saveSvg()),
      button("CSV", "Save the numbers", () => download(fileName(this.plot.title, "csv"), "text/csv", [numbers(this.plot, this.table)])),
      button("×", `Remove the plot ${this.plot.title}`, close),
    ];
  }

  // ---- numbers

  get question() {
    const times = this.data[0];
    const after = this.plot.kind === "time" && times.length ? times.at(-1) : -1;
    return { number: this.plot.number, after, thinned: this.thinned };
  }

  take(answer) {
    const { columns } = answer;
    if (!answer.added) this.earlier = answer.earlier;
    if (answer.added) this.data = this.data.map((column, at) => column.concat(columns[at]));
    else if (columns.length) this.data = this.plot.kind === "scatter" ? ascending(columns) : columns;
    this.thinned = answer.thinned;
    this.summary = answer.problem || answer.told;
    this.told.classList.toggle("wrong", answer.problem !== "");
    if (!this.pointing) this.tell();
    if (columns[0]?.length || !answer.added) this.draw();
  }

  // What is drawn: the numbers of this run, and beside them those of the future that it has left.
  get table() {
    return alongside(this.data, this.earlier);
  }

  // Where this run has left another one, as `partingOf` has it.
  part(parting) {
    if (JSON.stringify(parting) === JSON.stringify(this.parting)) return;
    this.parting = parting;
    if (this.earlier.length) this.draw();
  }

  // Under the chart: what is under the pointer, else the latest values.
  tell(at = null) {
    const [x, ...lines] = this.table;
    const last = at ?? x.indexOf(this.data[0].at(-1));
    const values = last >= 0 && (at !== null || this.plot.kind === "time") ? this.words(x, lines, last) : "";
    const text = [values, at === null ? this.summary : ""].filter(Boolean).join(" · ");
    write(this.told, text);
    this.element.setAttribute("aria-label", `${this.plot.title}. ${text}`);
  }

  words(x, lines, at) {
    const [unitX, unitY] = this.plot.units;
    const value = (number, unit) => (number === null ? "unknown" : `${short(number)}${unit ? ` ${unit}` : ""}`);
    const where = this.plot.kind === "time" ? clock(x[at]) : value(x[at], unitX);
    const { lines: names } = this.plot;
    const said = (some) =>
      some.map((line, index) => `${names.length > 1 ? `${names[index]} ` : ""}${value(atOrBefore(line, at), unitY)}`).join(", ");
    const earlier = lines.slice(names.length);
    const ended = !earlier.length || x[at] < this.earlier[0][0] || x[at] > this.earlier[0].at(-1);
    return `${where}: ${said(lines.slice(0, names.length))}${ended ? "" : ` · ${EARLIER}: ${said(earlier)}`}`;
  }

  // ---- the chart

  draw() {
    const width = this.place.clientWidth;
    if (!width) return;
    this.keyFutures();
    const data = this.table;
    if (this.chart && this.chart.series.length !== data.length) this.forget();
    const room = this.element.closest("[role=tabpanel]").clientHeight - AROUND - this.key.offsetHeight;
    const height = Math.max(HEIGHTS[0], Math.min(HEIGHTS[1], room));
    if (this.chart) {
      if (this.chart.width !== width || this.chart.height !== height) this.chart.setSize({ width, height });
      this.chart.setData(data);
    } else this.chart = new uPlot({ width, height, ...this.options() }, data, this.place);
  }

  // Name both futures, and say how they differ first.
  keyFutures() {
    this.key.hidden = !this.earlier.length;
    const text = this.parting?.text ?? "";
    write(this.parted, text && `· ${text}`);
    this.key.title = text;
  }

  // Let the chart be made anew.
  forget() {
    this.chart?.destroy();
    this.chart = null;
  }

  recolour() {
    this.forget();
    this.draw();
  }

  options() {
    const { plot } = this;
    const colours = inks();
    const axis = { stroke: colours.quiet, grid: { stroke: colours.grid, width: 1 }, ticks: { stroke: colours.grid, width: 1 }, font: "11px system-ui, sans-serif" };
    const times = plot.kind === "time" ? { incrs: TIMES, values: (_, values) => values.map(clock) } : { values: (_, values) => values.map(short) };
    return {
      legend: { show: false },
      padding: [8, 24, 0, 0],
      cursor: { sync: plot.kind === "time" ? { key: "time" } : undefined, drag: { x: true, y: false }, points: { show: plot.kind !== "scatter" } },
      scales: { x: { time: false, range: plot.kind === "histogram" ? around : undefined }, y: { range: (_, low, high) => rangeOf(plot, low, high) } },
      axes: [{ ...axis, size: 28, space: 70, ...times }, { ...axis, size: 52, values: (_, values) => values.map(short) }],
      series: [{}, ...this.series(colours)],
      bands: this.bands(colours),
      hooks: { setCursor: [(chart) => this.point(chart)], draw: [(chart) => this.drawParting(chart)] },
    };
  }

  series(colours) {
    const { plot } = this;
    const ink = colours.line;
    if (plot.kind === "scatter") return [{ stroke: ink, paths: () => null, points: { show: true, size: 4, fill: ink, stroke: ink, width: 0 } }];
    if (plot.kind === "histogram") return [{ stroke: ink, fill: ink, paths: uPlot.paths.bars({ size: [0.92, 100] }), points: { show: false } }];
    const line = (at, more) => ({ stroke: at ? `${ink}90` : ink, width: at ? 1 : 2, points: { show: false }, spanGaps: false, ...more });
    const earlier = this.earlier.length ? plot.lines.map((_, at) => line(at, { dash: at ? [2, 4] : [7, 4] })) : [];
    return [...plot.lines.map((_, at) => line(at)), ...earlier];
  }

  // A line across the chart where the futures part.
  drawParting(chart) {
    if (!this.earlier.length || !this.parting) return;
    const { ctx: pen, bbox } = chart;
    const x = Math.round(chart.valToPos(this.parting.at, "x", true));
    if (x < bbox.left || x > bbox.left + bbox.width) return;
    const ratio = devicePixelRatio;
    const { quiet, ground } = inks();
    pen.save();
    pen.strokeStyle = pen.fillStyle = quiet;
    pen.lineWidth = ratio;
    pen.setLineDash([2 * ratio, 2 * ratio]);
    pen.beginPath();
    pen.moveTo(x, bbox.top);
    pen.lineTo(x, bbox.top + bbox.height);
    pen.stroke();
    pen.font = `${11 * ratio}px system-ui, sans-serif`;
    pen.textBaseline = "top";
    const right = x > bbox.left + bbox.width / 2;
    pen.textAlign = right ? "right" : "left";
    const place = [x + (right ? -4 : 4) * ratio, bbox.top + 2 * ratio];
    pen.setLineDash([]);
    pen.strokeStyle = ground; // a line of the plot may lie below
    pen.lineWidth = 4 * ratio;
    pen.strokeText(this.parting.label, ...place);
    pen.fillText(this.parting.label, ...place);
    pen.restore();
  }

  // Lines around the main one are pairs, from the outermost to the innermost: what lies between two is shaded.
  bands({ line: ink }) {
    const count = this.plot.lines.length;
    const bands = [];
    for (let low = 2; low <= count / 2 + 0.5; low += 1) bands.push({ series: [count + 2 - low, low], fill: `${ink}28` });
    return this.plot.kind === "time" ? bands : [];
  }

  point(chart) {
    const { idx } = chart.cursor;
    this.pointing = idx !== null && idx !== undefined;
    this.tell(this.pointing ? idx : null);
  }

  // ---- out of the page

  savePng() {
    if (!this.chart) return;
    const { canvas } = this.chart.ctx;
    const ratio = canvas.width / this.chart.width;
    const colours = inks();
    const below = this.earlier.length ? 40 * ratio : 0;
    const image = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height + 30 * ratio + below });
    const pen = image.getContext("2d");
    pen.fillStyle = colours.ground;
    pen.fillRect(0, 0, image.width, image.height);
    pen.fillStyle = colours.ink;
    pen.font = `${13 * ratio}px system-ui, sans-serif`;
    pen.fillText(`${this.plot.title} · ${namesOf(this.plot).reverse().join(" over ")}`, 8 * ratio, 20 * ratio, image.width - 16 * ratio);
    pen.drawImage(canvas, 0, 30 * ratio);
    if (below) this.writeKey(pen, image, ratio, colours);
    image.toBlob((blob) => download(fileName(this.plot.title, "png"), "image/png", [blob]));
  }

  // Below a saved image: which line is which, and how the futures differ first.
  writeKey(pen, image, ratio, { line, ink }) {
    const y = image.height - 28 * ratio;
    let x = 8 * ratio;
    pen.lineWidth = 2 * ratio;
    pen.strokeStyle = line;
    pen.fillStyle = ink;
    pen.font = `${11 * ratio}px system-ui, sans-serif`;
    pen.textBaseline = "middle";
    for (const [name, dash] of [["this run", []], [EARLIER, [7 * ratio, 4 * ratio]]]) {
      pen.setLineDash(dash);
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + 24 * ratio, y);
      pen.stroke();
      pen.fillText(name, x + 30 * ratio, y);
      x += 42 * ratio + pen.measureText(name).width;
    }
    if (this.parting) pen.fillText(this.parting.text, 8 * ratio, y + 16 * ratio, image.width - 16 * ratio);
  }

  saveSvg() {
    if (!this.chart) return;
    const range = (name) => [this.chart.scales[name].min, this.chart.scales[name].max];
    download(fileName(this.plot.title, "svg"), "image/svg+xml", [figure(this.plot, this.table, { x: range("x"), y: range("y") }, inks(), this.parting)]);
  }
}

// Points in the order of x, as the chart wants them.
function ascending([x, y]) {
  const order = x.map((_, at) => at).sort((a, b) => x[a] - x[b]);
  return [order.map((at) => x[at]), order.map((at) => y[at])];
}

// Room for half a bar at either end.
function around(chart, low, high) {
  const half = chart.data[0].length > 1 ? (chart.data[0][1] - chart.data[0][0]) / 2 : 0.5;
  return [low - half, high + half];
}

function rangeOf(plot, low, high) {
  if (low === null || high === null) return [0, 1];
  if (plot.kind === "histogram") return [0, high * 1.05 || 1];
  const room = (high - low || Math.abs(high) || 1) * 0.06;
  return [low >= 0 && low - room < 0 ? 0 : low - room, high + room];
}

export class Plots {
  // names(): a promise of the names that an expression may use.
  constructor(root, wire, names) {
    this.root = root;
    this.wire = wire;
    this.find = (part) => root.querySelector(`.plots-${part}`);
    this.cards = new Map(); // by number
    this.open = false;
    this.asking = false;
    this.x = new ExpressionField(this.find("x"), names);
    this.y = new ExpressionField(this.find("y"), names);
    this.where = new ExpressionField(this.find("where"), names);
    for (const field of [this.x, this.y, this.where]) field.addEventListener("take", () => this.add());
    this.find("kind").addEventListener("change", () => this.kindChanged());
    this.find("add").addEventListener("click", () => this.add());
    for (const example of root.querySelectorAll("[data-plot]")) {
      example.addEventListener("click", () => this.try(JSON.parse(example.dataset.plot)));
    }
    this.parting = null;
    wire.addEventListener("plots", ({ detail }) => this.set(detail.plots));
    wire.addEventListener("span", ({ detail }) => this.part(partingOf(detail)));
    new ResizeObserver(() => this.open && this.draw()).observe(root);
    setInterval(() => {
      if (document.visibilityState === "visible") this.refresh();
    }, AGAIN);
    this.kindChanged();
  }

  shown(open) {
    this.open = open;
    if (!open) return;
    this.draw();
    this.refresh();
  }

  recolour() {
    for (const card of this.cards.values()) card.recolour();
  }

  draw() {
    for (const card of this.cards.values()) card.draw();
  }

  // Where this run has left another one.
  part(parting) {
    this.parting = parting;
    for (const card of this.cards.values()) card.part(parting);
  }

  // The plots that there are, as the desk says it.
  set(plots) {
    const before = JSON.stringify([...this.cards.values()].map(({ plot }) => plot));
    if (before === JSON.stringify(plots)) return;
    for (const [number, card] of this.cards) {
      const now = plots.find((plot) => plot.number === number);
      if (JSON.stringify(now) === JSON.stringify(card.plot)) continue;
      card.chart?.destroy();
      card.element.remove();
      this.cards.delete(number);
    }
    for (const plot of plots) {
      if (this.cards.has(plot.number)) continue;
      const card = new Card(plot, () => this.remove(plot.number));
      card.part(this.parting);
      this.cards.set(plot.number, card);
      this.find("cards").append(card.element);
    }
    this.find("empty").hidden = plots.length > 0;
    this.refresh();
  }

  // Ask for the numbers of every plot, one after the other.
  async refresh() {
    if (!this.open || this.asking) return;
    this.asking = true;
    let more = false;
    try {
      for (const card of [...this.cards.values()]) {
        const answer = await this.wire.ask("plotted", card.question);
        if (this.cards.get(card.plot.number) !== card) continue; // removed meanwhile
        card.take(answer);
        more ||= answer.more;
      }
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal; // the page says elsewhere that there is no connection
    } finally {
      this.asking = false;
    }
    if (more) setTimeout(() => this.refresh(), SOON);
  }

  // ---- adding and removing

  get kind() {
    return this.find("kind").value;
  }

  kindChanged() {
    this.find("what").hidden = this.kind !== "time";
    this.find("y").hidden = this.kind !== "scatter";
    const across = { time: "Expression, such as fuel", scatter: "Across, such as x", histogram: "Expression, such as fuel" };
    this.find("x").placeholder = across[this.kind];
  }

  try({ kind, x }) {
    this.find("kind").value = kind;
    this.kindChanged();
    this.x.set(x);
    this.x.field.focus();
  }

  async add() {
    const fields = { kind: this.kind, x: this.x.text, where: this.where.text };
    if (this.kind === "scatter") fields.y = this.y.text;
    if (this.kind === "time") fields.what = this.find("what").value;
    const sent = [this.x, this.y, this.where].map((field) => [field, field.text]);
    try {
      await this.wire.ask("plot", fields);
      this.say("");
      for (const [field, text] of sent) if (field.text === text) field.set("");
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message);
    }
  }

  async remove(number) {
    try {
      await this.wire.ask("unplot", { number });
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message);
    }
  }

  say(text) {
    this.find("told").textContent = text;
    this.find("told").hidden = !text;
  }
}
