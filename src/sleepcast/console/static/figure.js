// A plot as a figure of its own, for papers and slides: SVG with axes, drawn from the same numbers as on the page.

import { clock } from "./accounting.js";
import { EARLIER } from "./futures.js";
import { element, short, ticks } from "./scales.js";

const WIDTH = 640;
const HEIGHT = 360;
const LEFT = 70;
const RIGHT = 28;
const TOP = 34;
const BOTTOM = 48;
const KEY = 36; // pixels below for the names of two futures
const POINT = 2; // pixels: half of a point of a scatter plot

// The text of an SVG file. plot: as the station tells it; data: x and the lines; range: {x: [low, high], y: [low, high]}
// as shown on the page; colours: {ink, quiet, grid, ground, line}; parting: where an earlier future, whose lines follow
// those of this run, was left (see `partingOf`).
export function figure(plot, data, range, colours, parting = null) {
  const [left, right] = range.x;
  const [low, high] = range.y;
  const toX = (value) => LEFT + ((value - left) / (right - left || 1)) * (WIDTH - LEFT - RIGHT);
  const toY = (value) => HEIGHT - BOTTOM - ((value - low) / (high - low || 1)) * (HEIGHT - TOP - BOTTOM);
  const clip = element("clipPath", { id: "inside" }, element("rect", { x: LEFT, y: TOP, width: WIDTH - LEFT - RIGHT, height: HEIGHT - TOP - BOTTOM }));
  const marks = element("g", { "clip-path": "url(#inside)" }, ...drawn(plot, data, toX, toY, colours));
  const both = data.length > plot.lines.length + 1;
  const height = HEIGHT + (both ? KEY : 0);
  const svg = element(
    "svg",
    { xmlns: "http://www.w3.org/2000/svg", viewBox: `0 0 ${WIDTH} ${height}`, width: WIDTH, height, "font-family": "sans-serif", "font-size": 12 },
    element("defs", {}, clip),
    element("rect", { width: WIDTH, height, fill: colours.ground }),
    element("text", { x: LEFT, y: 20, fill: colours.ink, "font-size": 14 }, plot.title),
    ...axes(plot, range, toX, toY, colours),
    marks,
    ...(both ? futures(range, toX, colours, parting) : []),
  );
  return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(svg)}\n`;
}

// What the axes are called.
export function namesOf(plot) {
  const named = (text, unit) => (unit ? `${text} (${unit})` : text);
  if (plot.kind === "time") return ["time", named(plot.x, plot.units[1])];
  return [named(plot.x, plot.units[0]), plot.kind === "scatter" ? named(plot.y, plot.units[1]) : "robots"];
}

function axes(plot, range, toX, toY, colours) {
  const text = (words, attributes) => element("text", { fill: colours.quiet, ...attributes }, words);
  const parts = [];
  for (const value of ticks(...range.x, 7)) {
    parts.push(element("path", { d: `M${toX(value)} ${TOP}V${HEIGHT - BOTTOM}`, stroke: colours.grid }));
    const words = plot.kind === "time" ? clock(value) : short(value);
    parts.push(text(words, { x: toX(value), y: HEIGHT - BOTTOM + 16, "text-anchor": "middle" }));
  }
  for (const value of ticks(...range.y, 6)) {
    parts.push(element("path", { d: `M${LEFT} ${toY(value)}H${WIDTH - RIGHT}`, stroke: colours.grid }));
    parts.push(text(short(value), { x: LEFT - 6, y: toY(value) + 4, "text-anchor": "end" }));
  }
  const [across, up] = namesOf(plot);
  const middle = TOP + (HEIGHT - TOP - BOTTOM) / 2;
  parts.push(text(across, { x: LEFT + (WIDTH - LEFT - RIGHT) / 2, y: HEIGHT - 10, "text-anchor": "middle" }));
  parts.push(text(up, { x: 0, y: 0, transform: `translate(16 ${middle}) rotate(-90)`, "text-anchor": "middle" }));
  return parts;
}

// Which line is which, and a line where the futures part.
function futures(range, toX, { ink, quiet, ground, line }, parting) {
  const y = HEIGHT + 6;
  const text = (words, x, attributes) => element("text", { x, y: y + 4, fill: ink, ...attributes }, words);
  const swatch = (x, dash) => element("path", { d: `M${x} ${y}h24`, stroke: line, "stroke-width": 2, ...dash });
  const parts = [swatch(LEFT, {}), text("this run", LEFT + 30), swatch(LEFT + 90, { "stroke-dasharray": "7 4" }), text(EARLIER, LEFT + 120)];
  if (!parting) return parts;
  parts.push(text(parting.text, LEFT, { y: y + 20, "font-size": 11 }));
  if (parting.at < range.x[0] || parting.at > range.x[1]) return parts;
  const x = toX(parting.at);
  const right = x > WIDTH / 2;
  parts.push(element("path", { d: `M${x} ${TOP}V${HEIGHT - BOTTOM}`, stroke: quiet, "stroke-dasharray": "2 2" }));
  const halo = { "paint-order": "stroke", stroke: ground, "stroke-width": 4 }; // a line of the plot may lie below
  parts.push(element("text", { x: x + (right ? -4 : 4), y: TOP + 11, fill: quiet, "text-anchor": right ? "end" : "start", ...halo }, parting.label));
  return parts;
}

function drawn(plot, [x, ...lines], toX, toY, { line: ink }) {
  if (plot.kind === "scatter") {
    const points = x.map((value, at) => `M${toX(value) - POINT} ${toY(lines[0][at]) - POINT}h${2 * POINT}v${2 * POINT}h${-2 * POINT}z`);
    return [element("path", { d: points.join(""), fill: ink, "fill-opacity": 0.6 })];
  }
  if (plot.kind === "histogram") {
    const half = x.length > 1 ? (toX(x[1]) - toX(x[0])) * 0.46 : 20;
    const bars = x.map((value, at) => `M${toX(value) - half} ${toY(0)}V${toY(lines[0][at])}h${2 * half}V${toY(0)}z`);
    return [element("path", { d: bars.join(""), fill: ink })];
  }
  const count = plot.lines.length;
  const paths = lines.map((line, at) => {
    const main = at % count === 0;
    const dash = at < count ? {} : { "stroke-dasharray": main ? "7 4" : "2 4" };
    return element("path", { d: path(x, line, toX, toY), fill: "none", stroke: ink, "stroke-opacity": main ? 1 : 0.55, "stroke-width": main ? 2 : 1, ...dash });
  });
  return paths.reverse(); // the main line lies over the others
}

// A line with a gap wherever a value is unknown; what is undefined is not of this line.
function path(x, line, toX, toY) {
  let joined = false;
  let path = "";
  line.forEach((value, at) => {
    if (value === undefined) return;
    if (value !== null) path += `${joined ? "L" : "M"}${toX(x[at]).toFixed(1)} ${toY(value).toFixed(1)}`;
    joined = value !== null;
  });
  return path;
}

// The numbers of a plot as CSV.
export function numbers(plot, data) {
  const [across, up] = namesOf(plot);
  const lines = plot.lines.map((line) => `${line} ${up}`.trim());
  const both = data.length > lines.length + 1;
  const heads = plot.kind === "time" ? ["time (s)", ...lines, ...(both ? lines.map((line) => `${line}, ${EARLIER}`) : [])] : [across, up];
  const cell = (word) => (/[",\n]/.test(word) ? `"${word.replaceAll('"', '""')}"` : word);
  const rows = data[0].map((_, at) => data.map((column) => column[at] ?? "").join(","));
  return `${[heads.map(cell).join(","), ...rows].join("\n")}\n`;
}
