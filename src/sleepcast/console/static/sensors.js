// The sensors' pane: LongSensors and ShortSensors of the chosen robot, as in the thesis: its sonars as sectors, and where
// its bumper is hit, now and in the last minute.

import { make, section } from "./elements.js";
import { Past } from "./past.js";
import { drawBumper, drawSonars, sheet } from "./polar.js";
import { palette } from "./shapes.js";
import { UNITS } from "./view.js";

const KEPT = 60; // simulated seconds
const MOST = 600; // looks kept
const RINGS = [0.1, 0.25, 0.5, 1]; // of the farthest range

export class SensorsPane {
  // world: {scene, frame, marks} as of world.js
  constructor(world, senses) {
    this.world = world;
    this.senses = senses;
    this.open = false;
    this.looks = []; // [time, ranges, angles touched]
    this.note = make("p", { className: "empty" });
    this.long = canvas("ring");
    this.longPast = canvas("past");
    this.short = canvas("ring");
    this.shortPast = canvas("past");
    this.panes = [section("LongSensors", this.long, this.longPast), section("ShortSensors", this.short, this.shortPast)];
    this.root = make("div", { className: "sensing" }, this.note, ...this.panes);
    senses.shown.push(() => this.open);
    senses.addEventListener("sensed", () => this.take());
    world.addEventListener("choose", () => this.begin());
    new ResizeObserver(() => this.draw()).observe(this.root);
  }

  shown(open) {
    this.open = open;
    if (!open) return;
    this.senses.renew();
    this.begin();
  }

  // Another robot, or the pane is opened: what was seen before is not what is seen now.
  begin() {
    this.looks = [];
    this.draw();
  }

  take() {
    const { senses, world } = this;
    if (senses.body) {
      const { time } = world.frame;
      if (this.looks.length && time < this.looks.at(-1)[0]) this.looks = []; // time has gone back
      if (this.looks.at(-1)?.[0] !== time) this.looks.push([time, senses.body.sonars, touchedBy(senses.body)]);
      while (this.looks.length > MOST || this.looks[0][0] < time - KEPT) this.looks.shift();
    }
    this.draw();
  }

  draw() {
    if (!this.open) return;
    const { body, refusal } = this.senses;
    const none = this.world.marks.chosen < 0 ? "Click any robot to see what its sonars and its bumper sense." : refusal;
    this.note.textContent = body ? "" : none;
    this.note.hidden = !this.note.textContent;
    this.panes[0].hidden = !body?.sonars.length;
    this.panes[1].hidden = !body;
    if (!body) return;
    const colours = palette();
    const unit = this.world.scene.unit;
    const text = (range) => short(range / UNITS[unit]);
    const now = this.world.frame.time;
    if (body.sonars.length) {
      const said = drawSonars(sheet(this.long), {
        readings: body.sonars,
        farthest: body.farthest,
        rings: RINGS.map((part) => part * body.farthest),
        colour: colours.chosen,
        colours,
        text,
      });
      this.long.setAttribute("aria-label", `Sonars in ${unit}, from the front counter-clockwise: ${said}`);
      this.longPast.setAttribute("aria-label", "Sonars in the last minute");
      const past = new Past(sheet(this.longPast), now, colours);
      for (const [span, [, ranges]] of past.spans(this.looks)) past.ranges(span, ranges, body.farthest, colours.chosen);
    }
    const touched = touchedBy(body);
    const shown = { bumper: true, infrared: false };
    const said = drawBumper(sheet(this.short), { touched, infrared: [], sight: 1, colours, shown });
    this.short.setAttribute("aria-label", `Bumper: ${said}`);
    this.shortPast.setAttribute("aria-label", "Bumper in the last minute");
    const past = new Past(sheet(this.shortPast), now, colours);
    for (const [span, [, , angles]] of past.spans(this.looks)) past.bumps(span, angles, colours.place);
  }
}

// Two or three digits.
function short(value) {
  return value >= 9.95 ? String(Math.round(value)) : value.toFixed(1);
}

function canvas(className) {
  return make("canvas", { className, role: "img" });
}

function touchedBy(body) {
  return body.touched === null ? [] : [body.touched];
}
