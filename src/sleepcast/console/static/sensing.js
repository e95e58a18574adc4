// What robots sense and believe, as it is drawn on maps, in pixels of a View.

const TURN = 2 * Math.PI;
const LEAST = 5; // pixels: a robot's radius is never drawn smaller

export function sizeOf(view, radius) {
  return Math.max(LEAST, radius * view.scale);
}

export function disc(pen, x, y, size) {
  pen.moveTo(x + size, y);
  pen.arc(x, y, size, 0, TURN);
}

// A line from the middle outwards, between two parts of the radius.
export function spoke(pen, x, y, size, angle, from, to) {
  const [c, s] = [Math.cos(angle) * size, Math.sin(angle) * size];
  pen.moveTo(x + from * c, y - from * s);
  pen.lineTo(x + to * c, y - to * s);
}

// Where a robot believes to be: a dashed ring with its heading. size: its radius in pixels.
export function drawBelief(pen, view, [x, y, heading], size, colour) {
  const [px, py] = [view.toScreenX(x), view.toScreenY(y)];
  pen.beginPath();
  disc(pen, px, py, size);
  pen.setLineDash([4, 3]);
  pen.strokeStyle = colour;
  pen.lineWidth = 1.8;
  pen.stroke();
  pen.setLineDash([]);
  pen.beginPath();
  spoke(pen, px, py, size, heading, 0.5, 1.25);
  pen.stroke();
}

// Sectors of range sensors, evenly round from where they look, the last part of the pose: ranges in m from the body's edge,
// null for none; beam: how wide each is, rad.
export function drawCones(pen, view, [x, y, , looks], radius, ranges, farthest, colour, beam = TURN / ranges.length) {
  const half = beam / 2;
  const [px, py] = [view.toScreenX(x), view.toScreenY(y)];
  ranges.forEach((range, sensor) => {
    if (range === null) return;
    const middle = -(looks + (TURN * sensor) / ranges.length);
    const away = (radius + range) * view.scale;
    pen.beginPath();
    pen.moveTo(px, py);
    pen.arc(px, py, away, middle - half, middle + half);
    pen.closePath();
    pen.fillStyle = colour;
    pen.globalAlpha = range < farthest ? 0.1 : 0.03;
    pen.fill();
    if (range < farthest) {
      pen.beginPath();
      pen.arc(px, py, away, middle - half, middle + half);
      pen.globalAlpha = 0.7;
      pen.strokeStyle = colour;
      pen.lineWidth = 1.5;
      pen.stroke();
    }
  });
  pen.globalAlpha = 1;
}

// Where the bumper feels something: arcs on the body's rim. size: its radius in pixels. touched: rad from the
// heading.
export function drawTouches(pen, view, [x, y, heading], size, touched, colour) {
  const [px, py] = [view.toScreenX(x), view.toScreenY(y)];
  pen.strokeStyle = colour;
  pen.lineWidth = Math.max(4, size / 4);
  for (const angle of touched) {
    pen.beginPath();
    pen.arc(px, py, size + pen.lineWidth / 2, -(heading + angle) - 0.25, -(heading + angle) + 0.25);
    pen.stroke();
  }
}
