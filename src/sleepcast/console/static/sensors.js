// The sensors' pane: LongSensors and ShortSensors of the chosen robot, as in the thesis: its sonars as sectors, and where
// its bumper is hit, now and in the last minute.

import { Past } from "./past.js";
import { drawBumper, drawSonars, sheet } from "./polar.js";
import { palette } from "./shapes.js";
import { UNITS } from "./view.js";
import { Refusal } from "./wire.js";

const AGAIN = 150; // ms between an answer and the next question
const KEPT = 60; // simulated seconds
const MOST = 600; // looks kept
const RINGS = [0.1, 0.25, 0.5, 1]; // of the farthest range

export class SensorsPane {
  // world: {scene, frame, marks} as of world.js
  constructor(world, wire) {
    this.world = world;
    this.wire = wire;
    this.open = false;
    this.robot = -1;
    this.body = null; // what the desk said last of the robot
    this.looks = []; // [time, ranges, angles touched]
    this.root = make("div", "sensing");
    this.note = make("p", "empty");
    this.long = canvas("LongSensors");
    this.longPast = canvas("LongSensors, the last minute", "past");
    this.short = canvas("ShortSensors");
    this.shortPast = canvas("ShortSensors, the last minute", "past");
    this.panes = [section("LongSensors", this.long, this.longPast), section("ShortSensors", this.short, this.shortPast)];
    this.root.append(this.note, ...this.panes);
    world.addEventListener("choose", () => this.begin());
    new ResizeObserver(() => this.draw()).observe(this.root);
    this.say("");
  }

  shown(open) {
    this.open = open;
    if (open) this.begin();
  }

  recolour() {
    this.draw();
  }

  // Another robot, or the pane is opened: what was known is not about it.
  begin() {
    const { chosen } = this.world.marks;
    if (this.robot !== chosen) [this.robot, this.body, this.looks] = [chosen, null, []];
    if (this.open && !this.asking) this.ask();
    this.draw();
  }

  async ask() {
    const { robot } = this;
    if (!this.open) return;
    if (robot < 0) {
      this.say("Click any robot to see what its sonars and its bumper sense.");
      return;
    }
    this.asking = true;
    try {
      const { body } = await this.wire.ask("sense", { robot });
      if (robot === this.robot) this.take(body);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      if (robot === this.robot) this.say(refusal.message);
    } finally {
      this.asking = false;
    }
    setTimeout(() => this.asking || this.ask(), AGAIN);
  }

  take(body) {
    const { time } = this.world.frame;
    this.body = body;
    const touched = body.touched === null ? [] : [body.touched];
    if (this.looks.length && time < this.looks.at(-1)[0]) this.looks = []; // time has gone back
    if (this.looks.at(-1)?.[0] !== time) this.looks.push([time, body.sonars, touched]);
    while (this.looks.length > MOST || this.looks[0][0] < time - KEPT) this.looks.shift();
    this.say("");
    this.draw();
  }

  say(text) {
    this.note.textContent = text;
    this.note.hidden = !text;
    for (const pane of this.panes) pane.hidden = Boolean(text) || !this.body;
  }

  draw() {
    const { body } = this;
    if (!this.open || !body || !this.world.frame) return;
    const colours = palette();
    const unit = this.world.scene.unit;
    const text = (range) => short(range / UNITS[unit]);
    const now = this.world.frame.time;
    this.panes[0].hidden = body.sonars.length === 0;
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
      const past = new Past(sheet(this.longPast), now, colours);
      for (const [span, [, ranges]] of past.spans(this.looks)) past.ranges(span, ranges, body.farthest, colours.chosen);
    }
    const touched = body.touched === null ? [] : [body.touched];
    const shown = { bumper: true, infrared: false };
    const said = drawBumper(sheet(this.short), { touched, infrared: [], sight: 1, colours, shown });
    this.short.setAttribute("aria-label", `Bumper: ${said}`);
    const past = new Past(sheet(this.shortPast), now, colours);
    for (const [span, [, , angles]] of past.spans(this.looks)) past.bumps(span, angles, colours.place);
  }
}

// Two or three digits.
function short(value) {
  return value >= 9.95 ? String(Math.round(value)) : value.toFixed(1);
}

function make(tag, className, text = "") {
  return Object.assign(document.createElement(tag), { className, textContent: text });
}

function canvas(label, className = "ring") {
  const element = make("canvas", className);
  element.setAttribute("role", "img");
  element.setAttribute("aria-label", label);
  return element;
}

function section(title, ...parts) {
  const element = document.createElement("section");
  element.append(make("h2", "", title), ...parts);
  return element;
}
