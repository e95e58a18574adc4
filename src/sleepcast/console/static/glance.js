// The fleet at a glance, in the room of the robot pane while no robot is chosen: what robots sense first, over all of
// them, what they reported last, and how many stand still, have used up what they drive with, have crashed, or are not heard.

import { clock } from "./accounting.js";
import { make, write } from "./elements.js";
import { CRASHED, EXHAUSTED, SILENT, STILL } from "./frame.js";
import { Refusal } from "./wire.js";

const REFRESH = 1000; // ms between two looks
const HEADS = ["", "Least", "Median", "Greatest"];

// It tells ("choose", index) which robot was clicked in its list.
export class Glance extends EventTarget {
  constructor(root, wire) {
    super();
    this.root = root;
    this.wire = wire;
    this.body = make("tbody");
    const heads = HEADS.map((text) => make("th", { scope: "col" }, text));
    this.table = make("table", {}, make("thead", {}, make("tr", {}, ...heads)), this.body);
    this.told = make("p", { className: "told" });
    this.heading = make("h3", { hidden: true }, "Latest reports");
    this.reports = make("ol");
    this.known = ""; // what stands in the list
    root.append(this.told, this.table, this.heading, this.reports);
    this.news = null; // {scene, frame, past} as of the latest frame
    this.time = null; // simulated s of the frame at the last look,
    this.asked = null; // and of the one about which was asked last
    setInterval(() => this.look(), REFRESH);
  }

  // A frame has come. past: whether its values are made by running again.
  take(scene, frame, past) {
    this.news = { scene, frame, past };
  }

  // What is made by running again is asked for only once the time stays the same.
  look() {
    if (!this.news || !this.root.offsetParent) return;
    const { scene, frame, past } = this.news;
    this.tell(scene, frame);
    const stays = frame.time === this.time;
    this.time = frame.time;
    if (frame.time !== this.asked && (stays || !past)) this.ask();
  }

  async ask() {
    this.asked = this.time;
    try {
      const { quantities, reports } = await this.wire.ask("glance");
      this.show(quantities);
      this.list(reports);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal; // else the next look tells
    }
  }

  show(quantities) {
    this.table.hidden = quantities.length === 0;
    while (this.body.rows.length > quantities.length) this.body.lastChild.remove();
    while (this.body.rows.length < quantities.length) {
      this.body.append(make("tr", {}, make("th", { scope: "row" }), ...HEADS.slice(1).map(() => make("td"))));
    }
    quantities.forEach(({ name, shown, unknown }, place) => {
      const [head, ...cells] = this.body.rows[place].cells;
      write(head, unknown && shown.length ? `${name} (${unknown.toLocaleString("en")} unknown)` : name);
      cells.forEach((cell, at) => {
        write(cell, shown[at] ?? "unknown");
        cell.classList.toggle("none", !shown.length);
      });
    });
  }

  // reports: {at, text, robot} each, newest first
  list(reports) {
    const known = JSON.stringify(reports);
    if (known === this.known) return;
    this.known = known;
    this.heading.hidden = !reports.length;
    this.reports.replaceChildren(...reports.map(({ at, text, robot }) => {
      const name = make("button", { type: "button", title: "Choose this robot" }, robot);
      name.addEventListener("click", () => {
        const index = this.news.scene.names.indexOf(robot);
        if (index >= 0) this.dispatchEvent(new CustomEvent("choose", { detail: index })); // it may be gone
      });
      return make("li", {}, make("time", {}, clock(at)), name, make("span", {}, text));
    }));
  }

  tell(scene, { flags }) {
    const number = (flag) => flags.reduce((sum, each) => sum + (each & flag ? 1 : 0), 0);
    const count = (flag) => number(flag).toLocaleString("en");
    const said = [
      [count(STILL), "stopped or held"],
      ...(scene.supplies.length ? [[count(EXHAUSTED), `without ${scene.supplies.join(" or ")}`]] : []),
      ...(number(CRASHED) ? [[count(CRASHED), "crashed"]] : []),
      [count(SILENT), "not heard lately"],
      ...(scene.unheard ? [[scene.unheard.toLocaleString("en"), "never heard"]] : []),
    ];
    write(this.told, said.map((parts) => parts.join(" ")).join(" · "));
  }
}
