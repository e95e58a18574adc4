// What lies under the robots: the area, the grid with its unit, obstacles, named areas, lights. And, over them, the places.
// The names of all these are in labels.js.

import { gridStep } from "./view.js";

// under: what lies under the grid, the lowest first, each with a draw(pen, view), or null.
export function drawGround(pen, view, scene, colours, under = []) {
  pen.fillStyle = colours.ground;
  pen.fillRect(0, 0, view.width, view.height);
  const [left, bottom, right, top] = scene.area;
  pen.fillStyle = colours.area;
  pen.fillRect(view.toScreenX(left), view.toScreenY(top), (right - left) * view.scale, (top - bottom) * view.scale);
  for (const layer of under) layer?.draw(pen, view);
  const step = gridStep(view, scene.unit, 140).metres;
  drawGrid(pen, view, step, colours.grid);
  pen.strokeStyle = colours.edge;
  pen.lineWidth = 1;
  pen.strokeRect(view.toScreenX(left), view.toScreenY(top), (right - left) * view.scale, (top - bottom) * view.scale);
  pen.fillStyle = colours.obstacle;
  pen.strokeStyle = colours.wall;
  for (const outlines of scene.obstacles) {
    pen.beginPath();
    for (const corners of outlines) {
      pen.moveTo(view.toScreenX(corners[0][0]), view.toScreenY(corners[0][1]));
      for (const [x, y] of corners) pen.lineTo(view.toScreenX(x), view.toScreenY(y));
      pen.closePath();
    }
    pen.fill("evenodd");
    pen.stroke();
  }
  for (const named of scene.areas) drawArea(pen, view, named, colours);
  for (const light of scene.lights) drawLight(pen, view, light, colours);
}

// The outline of an area that robots know by name, or a way that they may go, with a dot at each of its places.
function drawArea(pen, view, { corners, closed = true }, colours) {
  const xs = corners.map(([x]) => view.toScreenX(x));
  const ys = corners.map(([, y]) => view.toScreenY(y));
  pen.beginPath();
  xs.forEach((x, corner) => pen.lineTo(x, ys[corner]));
  if (closed) pen.closePath();
  pen.globalAlpha = 0.6;
  pen.setLineDash([6, 5]);
  pen.strokeStyle = colours.place;
  pen.lineWidth = 1.2;
  pen.stroke();
  pen.setLineDash([]);
  pen.fillStyle = colours.place;
  if (!closed) xs.forEach((x, corner) => pen.fillRect(x - 2, ys[corner] - 2, 4, 4));
  pen.globalAlpha = 1;
}

export const GLOW = 70; // pixels

// A light: its glow on the ground, as wide on every scale.
function drawLight(pen, view, light, colours) {
  const x = view.toScreenX(light.x);
  const y = view.toScreenY(light.y);
  const glow = pen.createRadialGradient(x, y, 4, x, y, GLOW);
  glow.addColorStop(0, colours.light);
  glow.addColorStop(1, colours.area);
  pen.globalAlpha = 0.75;
  pen.fillStyle = glow;
  pen.beginPath();
  pen.arc(x, y, GLOW, 0, 2 * Math.PI);
  pen.fill();
  pen.globalAlpha = 1;
}

// Lines of the world's frame every `step` metres.
export function drawGrid(pen, view, step, colour) {
  const [left, top] = view.toWorld(0, 0);
  const [right, bottom] = view.toWorld(view.width, view.height);
  pen.beginPath();
  for (let k = Math.ceil(left / step); k * step <= right; k += 1) {
    const x = Math.round(view.toScreenX(k * step)) + 0.5;
    pen.moveTo(x, 0);
    pen.lineTo(x, view.height);
  }
  for (let k = Math.ceil(bottom / step); k * step <= top; k += 1) {
    const y = Math.round(view.toScreenY(k * step)) + 0.5;
    pen.moveTo(0, y);
    pen.lineTo(view.width, y);
  }
  pen.strokeStyle = colour;
  pen.lineWidth = 1;
  pen.stroke();
}

// Places: a crossed ring where each is.
export function drawPlaces(pen, view, places, colours) {
  for (const place of places) {
    const x = view.toScreenX(place.x);
    const y = view.toScreenY(place.y);
    pen.beginPath();
    pen.arc(x, y, 9, 0, 2 * Math.PI);
    for (const [dx, dy] of [[0, 1], [0, -1], [1, 0], [-1, 0]]) {
      pen.moveTo(x + 4 * dx, y + 4 * dy);
      pen.lineTo(x + 14 * dx, y + 14 * dy);
    }
    pen.strokeStyle = colours.ground;
    pen.lineWidth = 5;
    pen.stroke();
    pen.strokeStyle = colours.place;
    pen.lineWidth = 2.2;
    pen.stroke();
  }
}

// A name at a point, left out where it would cover one of the boxes; the box it took, in a list of one or none.
export function drawLabel(pen, view, text, x, y, colour, halo, font, boxes) {
  pen.font = font;
  const box = [x - 2, y - 8, x + pen.measureText(text).width + 2, y + 8];
  if (box[0] > view.width || box[2] < 0 || box[1] > view.height || box[3] < 0) return [];
  if (boxes.some((other) => box[0] < other[2] && box[2] > other[0] && box[1] < other[3] && box[3] > other[1])) return [];
  pen.textBaseline = "middle";
  pen.lineJoin = "round";
  pen.lineWidth = 4;
  pen.strokeStyle = halo;
  pen.strokeText(text, x, y);
  pen.fillStyle = colour;
  pen.fillText(text, x, y);
  return [box];
}
