// LongSensors: the sonars, each a sector with its reading in inches. ShortSensors: the bumper's contacts and, where
// there are infrared sensors, each a bar. What lies in front of the robot, or of the turret that carries its sensors, is up.
// Below each is its last minute.

import { palette } from "../shapes.js";
import { colourOf } from "./drawing.js";
import { Past } from "../past.js";
import { drawBumper, drawSonars, sheet } from "../polar.js";

const FARTHEST = 255; // inches: what a sonar reads where there is nothing
const RINGS = [24, 60, 120, 255]; // inches
const INFRARED = 24; // inches: what an infrared sensor sees at most

export class Sensors {
  constructor(root, state) {
    this.state = state;
    this.long = root.querySelector("#long");
    this.short = root.querySelector("#short");
    this.longPast = root.querySelector("#long-past");
    this.shortPast = root.querySelector("#short-past");
    this.colours = palette();
  }

  recolour() {
    this.colours = palette();
    this.draw();
  }

  draw() {
    const { own } = this.state;
    if (!own) return;
    this.drawLong(sheet(this.long), own);
    this.drawShort(sheet(this.short), own);
    this.drawLongPast(new Past(sheet(this.longPast), this.state.time, this.colours));
    this.drawShortPast(new Past(sheet(this.shortPast), this.state.time, this.colours));
  }

  drawLongPast(past) {
    const { colours, state } = this;
    const farthest = (FARTHEST - 0.5) * 10 * state.tenth;
    const shown = state.shown.sonar ? state.far : [];
    let nearest = farthest;
    for (const [span, [, ranges]] of past.spans(shown)) {
      past.ranges(span, ranges, farthest, colourOf(state.chosen, colours));
      nearest = Math.min(nearest, ...ranges.map((range) => range ?? farthest));
    }
    const said = nearest < farthest ? `the nearest reading was ${state.inches(nearest)} inches` : "nothing was near";
    this.longPast.setAttribute("aria-label", `Sonars in the last minute: ${said}`);
  }

  drawShortPast(past) {
    const { colours, state } = this;
    const farthest = (INFRARED - 0.5) * 10 * state.tenth;
    let [hits, before] = [0, false];
    for (const [span, [, ranges, touched]] of past.spans(state.near)) {
      if (state.shown.infrared) past.ranges(span, ranges, farthest, colours.lit);
      if (!state.shown.bumper) continue;
      past.bumps(span, touched, colours.place);
      hits += Number(touched.length > 0 && !before);
      before = touched.length > 0;
    }
    this.shortPast.setAttribute("aria-label", `Bumper in the last minute: hit ${hits === 1 ? "once" : `${hits} times`}`);
  }

  drawLong(canvas, own) {
    const { colours, state } = this;
    const inch = 10 * state.tenth;
    const said = drawSonars(canvas, {
      readings: own.sonars,
      farthest: (FARTHEST - 0.5) * inch,
      rings: RINGS.map((ring) => ring * inch),
      colour: colourOf(state.chosen, colours),
      colours,
      shown: state.shown.sonar,
      text: (range) => String(Math.min(FARTHEST, state.inches(range))),
    });
    this.long.setAttribute("aria-label", `Sonars in inches, from the front counter-clockwise: ${said}`);
  }

  drawShort(canvas, own) {
    const { colours, state } = this;
    const said = drawBumper(canvas, {
      touched: own.touched,
      infrared: own.infrared,
      sight: INFRARED * 10 * state.tenth,
      colours,
      shown: state.shown,
      none: "no infrared",
    });
    this.short.setAttribute("aria-label", `Bumper: ${said}`);
  }
}
