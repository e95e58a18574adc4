// The sensors' pane: LongSensors and ShortSensors of the chosen robot, as in the thesis: its sonars as sectors, and where
// its bumper is hit, now and in the last minute.

import { make, section } from "./elements.js";
import { Past } from "./past.js";
import { drawBumper, drawSonars, sheet } from "./polar.js";
import { palette } from "./shapes.js";
import { UNITS } from "./view.js";

const RINGS = [0.1, 0.25, 0.5, 1]; // of the farthest range

export class SensorsPane {
  // world: {scene, frame, marks} as of world.js. shows: whether what a kind of sensors measured is shown.
  constructor(world, senses, shows = () => true) {
    this.world = world;
    this.senses = senses;
    this.shows = shows;
    this.open = false;
    this.note = make("p", { className: "empty" });
    this.long = canvas("ring");
    this.longPast = canvas("past");
    this.short = canvas("ring");
    this.shortPast = canvas("past");
    this.panes = [section("LongSensors", this.long, this.longPast), section("ShortSensors", this.short, this.shortPast)];
    this.root = make("div", { className: "sensing" }, this.note, ...this.panes);
    senses.shown.push(() => this.open);
    senses.addEventListener("sensed", () => this.draw());
    world.addEventListener("choose", () => this.draw());
    world.addEventListener("layers", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.root);
  }

  shown(open) {
    this.open = open;
    if (!open) return;
    this.senses.renew();
    this.draw();
  }

  draw() {
    if (!this.open) return;
    const { body, refusal, far, near } = this.senses;
    const none = this.world.marks.chosen < 0 ? "Click any robot to see what its sonars and its bumper sense." : refusal;
    this.note.textContent = body ? "" : none;
    this.note.hidden = !this.note.textContent;
    this.panes[0].hidden = !body?.sonars.length;
    this.panes[1].hidden = !body;
    if (!body) return;
    if (!this.world.frame) return;
    const colours = palette();
    this.drawLong(body, far, colours);
    this.drawShort(body, near, colours);
  }

  drawLong(body, far, colours) {
    if (!body.sonars.length) return;
    const { unit } = this.world.scene;
    const text = (range) => short(range / UNITS[unit]);
    const shown = this.shows("sonar");
    const said = drawSonars(sheet(this.long), {
      readings: body.sonars,
      farthest: body.farthest,
      rings: RINGS.map((part) => part * body.farthest),
      colour: colours.chosen,
      colours,
      shown,
      text,
    });
    this.long.setAttribute("aria-label", `Sonars in ${unit}, from the front counter-clockwise: ${said}`);
    const past = new Past(sheet(this.longPast), this.world.frame.time, colours);
    let nearest = Infinity;
    for (const [span, [, ranges]] of past.spans(shown ? far : [])) {
      past.ranges(span, ranges, body.farthest, colours.chosen);
      for (const range of ranges) nearest = Math.min(nearest, range ?? Infinity);
    }
    const least = nearest < body.farthest ? `the nearest reading was ${text(nearest)} ${unit}` : "nothing was near";
    this.longPast.setAttribute("aria-label", `Sonars in the last minute: ${least}`);
  }

  drawShort(body, near, colours) {
    const { infrared, sight, touched } = body;
    const shown = { bumper: this.shows("bumper"), infrared: this.shows("infrared") };
    const said = drawBumper(sheet(this.short), { touched, infrared, sight, colours, shown, none: this.world.scene.discs ? "no infrared" : "" });
    this.short.setAttribute("aria-label", `Bumper: ${said}`);
    const past = new Past(sheet(this.shortPast), this.world.frame.time, colours);
    let [hits, before] = [0, false];
    for (const [span, [, ranges, angles]] of past.spans(near)) {
      if (shown.infrared) past.ranges(span, ranges, sight, colours.lit);
      if (!shown.bumper) continue;
      past.bumps(span, angles, colours.place);
      hits += Number(angles.length > 0 && !before);
      before = angles.length > 0;
    }
    this.shortPast.setAttribute("aria-label", `Bumper in the last minute: hit ${hits === 1 ? "once" : `${hits} times`}`);
  }
}

// Two or three digits.
function short(value) {
  return String(value >= 9.95 ? Math.round(value) : Number(value.toFixed(1)));
}

function canvas(className) {
  return make("canvas", { className, role: "img" });
}
