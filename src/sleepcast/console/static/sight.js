// What the chosen robot sees, on the map, while its layer is shown: lines to what is in the reach of its senses, dashed up
// to what hides the rest, the area that it overlooks between walls, and where the beams of its scanner end.

import { disc } from "./sensing.js";
import { Asking } from "./senses.js";

const CROSS = 4; // pixels: half of the mark where a line is blocked
const DOT = 3; // pixels: the side of the mark where a beam ends
const SENSES = { neighbours: "other robots", pings: "robots whose pings it hears", lights: "lights" };

export class SightLayer extends Asking {
  // menu: the element that holds the layers.
  constructor(world, wire, menu) {
    super(world, wire, "sight");
    this.menu = menu;
    world.tools.push(this);
    this.shown.push(() => world.shows("sight") && this.there);
    this.addEventListener("sensed", () => world.repaint("robots"));
    world.addEventListener("layers", () => this.renew());
  }

  // senses: of the robots that see or hear something; the desk does not say where nobody can tell.
  setScene({ senses = [] }) {
    this.there = senses.length > 0;
    const line = this.menu.querySelector("#layer-sight")?.closest(".layer");
    if (!line) return;
    line.hidden = !this.there;
    line.querySelector("label").title = hint(senses);
    this.renew();
  }

  drawBehind(pen) {
    const { told, world } = this;
    if (!told || !world.shows("sight") || world.marks.chosen >= world.frame.count) return;
    const { view, colours, marks } = world;
    const { sight } = told;
    drawArea(pen, view, sight.area, colours.chosen);
    drawScan(pen, view, sight.scan, colours.place);
    const from = placeOf(world, marks.chosen, sight);
    for (const line of sight.lines) drawLine(pen, view, from, line, placeOf(world, line.robot, line), colours);
  }
}

// Where a robot is in this frame, which may be newer than the answer; on a torus its image is told.
function placeOf({ frame: { poses, count }, scene: { area: [left, bottom, right, top] } }, robot, { x, y }) {
  if (robot < 0 || robot >= count) return [x, y];
  const [nowX, nowY] = [poses[3 * robot], poses[3 * robot + 1]];
  const same = Math.abs(nowX - x) < (right - left) / 2 && Math.abs(nowY - y) < (top - bottom) / 2;
  return same ? [nowX, nowY] : [x, y];
}

function hint(senses) {
  const seen = senses.filter((sense) => sense in SENSES).map((sense) => SENSES[sense]);
  const lines = seen.length ? [`Lines to ${seen.join(" and ")} in reach, dashed up to what hides the rest`] : [];
  const dots = senses.includes("scanner") ? ["Dots where the beams of its scanner end"] : [];
  return [...lines, ...dots].join(". ");
}

function drawScan(pen, view, points, colour) {
  pen.fillStyle = colour;
  for (const [x, y] of points) pen.fillRect(view.toScreenX(x) - DOT / 2, view.toScreenY(y) - DOT / 2, DOT, DOT);
}

function drawArea(pen, view, corners, colour) {
  if (!corners.length) return;
  pen.beginPath();
  for (const [x, y] of corners) pen.lineTo(view.toScreenX(x), view.toScreenY(y));
  pen.closePath();
  pen.fillStyle = pen.strokeStyle = colour;
  pen.globalAlpha = 0.09;
  pen.fill();
  pen.globalAlpha = 0.35;
  pen.lineWidth = 1;
  pen.stroke();
  pen.globalAlpha = 1;
}

function drawLine(pen, view, [x, y], { sense, robot, stop }, [toX, toY], colours) {
  const [px, py] = [view.toScreenX(x), view.toScreenY(y)];
  const [endX, endY] = stop ?? [toX, toY];
  const [ex, ey] = [view.toScreenX(endX), view.toScreenY(endY)];
  pen.strokeStyle = stop ? colours.quiet : sense === "lights" ? colours.lit : colours.chosen;
  pen.lineWidth = stop ? 1 : 1.5;
  if (stop) pen.setLineDash([4, 4]);
  else if (sense === "pings") pen.setLineDash([1, 3]);
  pen.beginPath();
  pen.moveTo(px, py);
  pen.lineTo(ex, ey);
  pen.stroke();
  pen.setLineDash([]);
  pen.beginPath();
  if (stop) drawCross(pen, ex, ey);
  else if (robot < 0) disc(pen, ex, ey, 3);
  pen.stroke();
}

function drawCross(pen, x, y) {
  for (const side of [-1, 1]) {
    pen.moveTo(x - CROSS, y - side * CROSS);
    pen.lineTo(x + CROSS, y + side * CROSS);
  }
}
