// LongSensors: the sonars, each a sector with its reading in inches. ShortSensors: the bumper's contacts and, where
// there are infrared sensors, each a bar. What lies in front of the robot, or of the turret that carries its sensors, is up.
// Below each is its last minute.

import { palette } from "../shapes.js";
import { colourOf } from "./drawing.js";
import { Past } from "./past.js";

const TURN = 2 * Math.PI;
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

  drawLong({ pen, width, height }, own) {
    const { colours, state } = this;
    const [x, y] = [width / 2, height / 2];
    const most = Math.min(width, height) / 2 - 16;
    const away = (inches) => most * Math.sqrt(Math.min(inches, FARTHEST) / FARTHEST); // what is near counts most
    pen.strokeStyle = colours.grid;
    for (const ring of RINGS) circle(pen, x, y, away(ring));
    const readings = own.sonars.map((metres) => (metres === null ? null : Math.min(FARTHEST, state.inches(metres))));
    const half = Math.PI / readings.length;
    const colour = colourOf(state.chosen, colours);
    pen.font = "600 11px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    readings.forEach((inches, sonar) => {
      const middle = -TURN / 4 - (TURN * sonar) / readings.length;
      const heard = state.shown.sonar && inches !== null && inches < FARTHEST;
      if (heard) {
        pen.beginPath();
        pen.moveTo(x, y);
        pen.arc(x, y, away(inches), middle - half + 0.02, middle + half - 0.02);
        pen.closePath();
        pen.fillStyle = colour;
        pen.globalAlpha = 0.3;
        pen.fill();
        pen.globalAlpha = 1;
        pen.lineWidth = 1.5;
        pen.strokeStyle = colour;
        pen.stroke();
      }
      pen.fillStyle = heard ? colours.ink : colours.quiet;
      pen.fillText(inches ?? "–", x + (most + 9) * Math.cos(middle), y + (most + 7) * Math.sin(middle));
    });
    nose(pen, x, y, 7, colours.ink);
    const said = readings.map((each) => each ?? "none").join(", ");
    this.long.setAttribute("aria-label", `Sonars in inches, from the front counter-clockwise: ${said}`);
  }

  drawShort({ pen, width, height }, own) {
    const { colours, state } = this;
    const [x, y] = [width / 2, height / 2];
    const size = Math.min(width, height) / 2 - 30;
    if (state.shown.infrared) this.drawInfrared(pen, x, y, size, own);
    pen.strokeStyle = colours.edge;
    pen.lineWidth = 6;
    circle(pen, x, y, size);
    pen.lineWidth = 10;
    pen.strokeStyle = colours.place;
    if (state.shown.bumper) {
      for (const angle of own.touched) {
        pen.beginPath();
        pen.arc(x, y, size, -TURN / 4 - angle - 0.22, -TURN / 4 - angle + 0.22);
        pen.stroke();
      }
    }
    nose(pen, x, y - size + 20, 7, colours.quiet);
    const degrees = own.touched.map((angle) => Math.round((angle * 360) / TURN)).map((each) => `${each}°`);
    const hit = degrees.length ? `hit at ${degrees[0]}` : "free";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.fillStyle = degrees.length ? colours.place : colours.quiet;
    pen.font = `${degrees.length ? 700 : 400} 13px system-ui, sans-serif`;
    pen.fillText(hit, x, y);
    pen.fillStyle = colours.quiet;
    pen.font = "11px system-ui, sans-serif";
    if (!own.infrared.length) pen.fillText("no infrared", x, height - 9);
    const said = degrees.length ? `hit at ${degrees.join(", ")} from the front` : "free";
    this.short.setAttribute("aria-label", `Bumper: ${said}`);
  }

  drawInfrared(pen, x, y, size, own) {
    const { colours, state } = this;
    pen.lineWidth = 4;
    own.infrared.forEach((metres, sensor) => {
      const inches = metres === null ? INFRARED : Math.min(INFRARED, state.inches(metres));
      const angle = -TURN / 4 - (TURN * sensor) / own.infrared.length;
      const length = 3 + 21 * (1 - inches / INFRARED);
      pen.beginPath();
      pen.moveTo(x + (size + 5) * Math.cos(angle), y + (size + 5) * Math.sin(angle));
      pen.lineTo(x + (size + 5 + length) * Math.cos(angle), y + (size + 5 + length) * Math.sin(angle));
      pen.strokeStyle = inches < INFRARED ? colours.lit : colours.grid;
      pen.stroke();
    });
  }
}

// A canvas made fit for what it shows, and cleared.
function sheet(canvas) {
  const { width, height } = canvas.getBoundingClientRect();
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const [across, up] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== across || canvas.height !== up) [canvas.width, canvas.height] = [across, up];
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

function circle(pen, x, y, size) {
  pen.beginPath();
  pen.arc(x, y, Math.max(0, size), 0, TURN);
  pen.stroke();
}

// A small arrowhead that points to the front.
function nose(pen, x, y, size, colour) {
  pen.beginPath();
  pen.moveTo(x, y - size);
  pen.lineTo(x + 0.7 * size, y + 0.7 * size);
  pen.lineTo(x, y + 0.3 * size);
  pen.lineTo(x - 0.7 * size, y + 0.7 * size);
  pen.closePath();
  pen.fillStyle = colour;
  pen.fill();
}
