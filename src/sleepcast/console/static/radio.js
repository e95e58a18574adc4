// The radio's pane: copies that arrived and those that did not, messages and bytes by kind, as rates over time. The desk
// tells sums; what is drawn is by how much they grew each second. Nothing is asked for while the pane is closed.

import { clock } from "./accounting.js";
import { make, write } from "./elements.js";
import { Card } from "./plots.js";
import { short } from "./scales.js";
import { Refusal } from "./wire.js";

const AGAIN = 1000; // ms between two looks
const INKS = ["--accent", "--bad", "--warn", "--alternate", "--good"]; // of the lines, in turn

function ink(at) {
  return getComputedStyle(document.documentElement).getPropertyValue(INKS[at % INKS.length]).trim();
}

// A chart of some sums: each line has a colour of its own, and a key that names it with its sum.
class RadioCard extends Card {
  constructor({ title, lines, first }) {
    super({ number: 0, kind: "time", title, x: title, y: "", where: "", lines, units: ["s", "/s"] }, () => {});
    this.first = first;
    this.sums = make("p", { className: "plot-key" });
    this.element.insertBefore(this.sums, this.told);
  }

  buttons(close) {
    return super.buttons(close).slice(0, -1); // it stays
  }

  // columns: times, and the sums of all charts.
  show(columns, summary) {
    const own = columns.slice(1 + this.first, 1 + this.first + this.plot.lines.length);
    this.take({ columns: [columns[0], ...own.map((sums) => growth(columns[0], sums))], earlier: [], thinned: 0, told: summary, problem: "" });
    const keys = this.plot.lines.map((name, at) => {
      const line = make("i");
      line.style.borderTopColor = ink(at);
      const key = make("span", {}, line, `${name} ${short(own[at].at(-1) ?? 0)}`);
      key.style.whiteSpace = "nowrap";
      return key;
    });
    this.sums.replaceChildren(...keys.flatMap((key) => [key, " "]));
  }

  // In words, only what there has been any of.
  words(times, lines, at) {
    const some = this.plot.lines.map((name, line) => [name, lines[line][at]]).filter(([, rate]) => rate !== null);
    return `${clock(times[at])}: ${some.map(([name, rate]) => `${name} ${short(rate)}/s`).join(", ") || "nothing yet"}`;
  }

  series() {
    return this.plot.lines.map((_, at) => ({ stroke: ink(at), width: 2, points: { show: false }, spanGaps: true }));
  }

  bands() {
    return [];
  }
}

// By how much sums grew each second up to each time; unknown at the first, and where there never was anything, so that no
// line of zeros covers another one.
function growth(times, sums) {
  const nothing = !sums.some(Boolean);
  return sums.map((sum, at) => (at && !nothing ? (sum - sums[at - 1]) / (times[at] - times[at - 1]) : null));
}

export class RadioPane {
  constructor(wire) {
    this.wire = wire;
    this.open = false;
    this.asking = false;
    this.columns = [];
    this.thinned = 0;
    this.cards = [];
    this.note = make("p", { className: "chart-note" });
    this.places = make("div", { className: "chart-cards" });
    this.root = make("div", { className: "chart-pane" }, this.places, this.note);
    new ResizeObserver(() => this.open && this.draw()).observe(this.root);
    setInterval(() => {
      if (document.visibilityState === "visible") this.refresh();
    }, AGAIN);
  }

  shown(open) {
    this.open = open;
    if (open) this.refresh();
  }

  draw() {
    for (const card of this.cards) card.draw();
  }

  recolour() {
    for (const card of this.cards) {
      card.forget();
      card.show(this.columns, this.summary);
    }
  }

  async refresh() {
    if (!this.open || this.asking) return;
    this.asking = true;
    try {
      this.take(await this.wire.ask("radio", { after: this.columns[0]?.at(-1) ?? -1, thinned: this.thinned }));
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal; // the page says elsewhere that there is no connection
      write(this.note, refusal.message);
    } finally {
      this.asking = false;
    }
  }

  take({ charts, columns, added, thinned, told }) {
    this.columns = added ? this.columns.map((column, at) => column.concat(columns[at])) : columns;
    this.thinned = thinned;
    this.summary = told;
    write(this.note, "The numbers beside the names are sums: of copies since the run began, of messages and bytes since the page did. Bytes are those of signed messages on a real network. Telemetry is not counted.");
    if (!this.cards.length) {
      this.cards = charts.map((chart) => new RadioCard(chart));
      this.places.append(...this.cards.map((card) => card.element));
    }
    for (const card of this.cards) card.show(this.columns, told);
  }
}
