// How Nomads, their traces and what their programs draw look on maps, in pixels of a View.

import { disc, sizeOf, spoke } from "../sensing.js";

// Modes 4 and on of what programs draw; 1 to 3 are the pen's own colour.
const NAMED = [
  "#d62728", "#1f77b4", "#2ca02c", "#e6a700", "#9467bd", "#17a2b8", "#e377c2", "#8c564b", "#ff7f0e", "#7f8c8d",
  "#b0173f", "#3f51b5", "#0f7f5f", "#a6841a", "#6a3fb5", "#2a9d8f", "#c0399f", "#6d4c41", "#d9541e", "#546e7a",
];

// The colour of what a program has drawn in this mode.
function sketchColour(mode, colours) {
  return mode > 3 ? NAMED[(mode - 4) % NAMED.length] : colours.ink;
}

// A trace of x, y in turn, null for a gap; the encoders' is dashed.
export function drawTrace(pen, view, points, colour, dashed) {
  if (points.length < 4) return;
  pen.beginPath();
  for (let i = 0, gap = true; i < points.length; i += 2) {
    if (points[i] !== null) {
      const at = [view.toScreenX(points[i]), view.toScreenY(points[i + 1])];
      if (gap) pen.moveTo(...at);
      else pen.lineTo(...at);
    }
    gap = points[i] === null;
  }
  pen.strokeStyle = colour;
  pen.lineWidth = 1.6;
  pen.lineJoin = "round";
  pen.setLineDash(dashed ? [5, 4] : []);
  pen.globalAlpha = dashed ? 0.8 : 0.65;
  pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}

export function drawSketches(pen, view, sketches, radius, colours) {
  pen.lineWidth = 1.5;
  for (const { kind, numbers, mode } of sketches) {
    pen.strokeStyle = sketchColour(mode, colours);
    pen.beginPath();
    if (kind === "line") {
      pen.moveTo(view.toScreenX(numbers[0]), view.toScreenY(numbers[1]));
      pen.lineTo(view.toScreenX(numbers[2]), view.toScreenY(numbers[3]));
    } else if (kind === "arc") {
      const [left, top, width, height, from, to] = numbers;
      const [x, y] = [view.toScreenX(left + width / 2), view.toScreenY(top - height / 2)];
      const [across, up] = [(Math.abs(width) / 2) * view.scale, (Math.abs(height) / 2) * view.scale];
      pen.ellipse(x, y, across, up, 0, -from, -to, to > from);
    } else {
      const [x, y, heading, turret] = numbers;
      const size = sizeOf(view, radius);
      disc(pen, view.toScreenX(x), view.toScreenY(y), size);
      spoke(pen, view.toScreenX(x), view.toScreenY(y), size, heading, 0, 1);
      spoke(pen, view.toScreenX(x), view.toScreenY(y), size, turret, 0.5, 0.8);
    }
    pen.stroke();
  }
}

// A body with its turret. size: its radius in pixels.
export function drawBody(pen, view, pose, size, colour, colours, strong = false) {
  const [px, py] = [view.toScreenX(pose[0]), view.toScreenY(pose[1])];
  pen.beginPath();
  disc(pen, px, py, size);
  pen.fillStyle = colour;
  pen.fill();
  pen.lineWidth = strong ? 3 : 1.2;
  pen.strokeStyle = strong ? colours.ink : colours.area;
  pen.stroke();
  pen.beginPath();
  spoke(pen, px, py, size, pose[2], 0.25, 1);
  pen.strokeStyle = colours.area;
  pen.lineWidth = Math.max(1.6, size / 6);
  pen.stroke();
  drawTurret(pen, view, pose, size, colour);
}

// Where a turret points, if not ahead.
export function drawTurret(pen, view, [x, y, heading, turret], size, colour) {
  if (Math.abs(Math.sin((turret - heading) / 2)) <= 0.01) return;
  pen.beginPath();
  spoke(pen, view.toScreenX(x), view.toScreenY(y), size, turret, 0.9, 1.5);
  pen.strokeStyle = colour;
  pen.lineWidth = Math.max(1.6, size / 6);
  pen.stroke();
}

// Dots at places [x, y].
export function drawDots(pen, view, points, size, colour) {
  pen.fillStyle = colour;
  for (const [x, y] of points) pen.fillRect(view.toScreenX(x) - size / 2, view.toScreenY(y) - size / 2, size, size);
}

// Crosses at places, x and y in turn.
export function drawCrosses(pen, view, points, size, colour) {
  pen.beginPath();
  for (let i = 0; i < points.length; i += 2) {
    const [x, y] = [view.toScreenX(points[i]), view.toScreenY(points[i + 1])];
    pen.moveTo(x - size, y - size);
    pen.lineTo(x + size, y + size);
    pen.moveTo(x + size, y - size);
    pen.lineTo(x - size, y + size);
  }
  pen.strokeStyle = colour;
  pen.lineWidth = 1.6;
  pen.stroke();
}
