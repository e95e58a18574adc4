// The last minute of what a ring of sensors measured: time goes to the right, the front of the robot is in the middle,
// and what was near is painted stronger.

const TURN = 2 * Math.PI;
const PAST = 60; // simulated seconds
const SIDES = [["left", 0.25], ["front", 0.5], ["right", 0.75]]; // and how far down they are
const [LEFT, RIGHT, BELOW] = [34, 4, 13]; // pixels beside the field
const BUMP = 0.08; // of the turn, how wide a contact is painted

export class Past {
  // sheet: {pen, width, height}. now: simulated seconds.
  constructor({ pen, width, height }, now, colours) {
    this.pen = pen;
    this.now = now;
    this.across = (width - LEFT - RIGHT) / PAST; // pixels a second
    this.high = Math.round(height - BELOW);
    this.frame(height, colours);
  }

  frame(height, colours) {
    const { pen, across, high } = this;
    const end = LEFT + PAST * across;
    pen.font = "10.5px system-ui, sans-serif";
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    pen.lineWidth = 1;
    pen.strokeStyle = colours.edge;
    pen.fillStyle = colours.quiet;
    pen.strokeRect(LEFT, 0.5, PAST * across, high - 1);
    for (const [side, down] of SIDES) {
      const y = Math.round(down * high) + 0.5;
      pen.fillText(side, LEFT - 4, y);
      pen.beginPath();
      pen.moveTo(LEFT, y);
      pen.lineTo(end, y);
      pen.stroke();
    }
    pen.fillText("now", end, height - 5);
    pen.textAlign = "left";
    pen.fillText(`${PAST} s ago`, LEFT, height - 5);
  }

  // Each look of a row, with the times between which it was the latest.
  spans(looks) {
    return looks.map((look, at) => [[look[0], looks[at + 1]?.[0] ?? this.now], look]);
  }

  // Ranges in m that sensors measured, evenly round from the front counter-clockwise; what is not nearer than
  // `farthest` is nothing. span: the times between which this was the latest look.
  ranges(span, ranges, farthest, colour) {
    ranges.forEach((range, sensor) => {
      if (range === null || range >= farthest) return;
      const strength = 0.08 + 0.92 * (1 - Math.sqrt(range / farthest)) ** 1.5;
      this.plot(span, sensor / ranges.length, 1 / ranges.length, colour, strength);
    });
  }

  // Contacts at these angles, rad.
  bumps(span, touched, colour) {
    for (const angle of touched) this.plot(span, angle / TURN, BUMP, colour, 1);
  }

  // Paint a part of the turn, from the front counter-clockwise.
  plot(span, turn, wide, colour, strength) {
    const { pen, high } = this;
    const [begin, end] = span.map((time) => Math.round(LEFT + Math.max(0, PAST - (this.now - time)) * this.across));
    if (end <= begin) return;
    pen.fillStyle = colour;
    pen.globalAlpha = strength;
    const top = ((((0.5 - turn - wide / 2) % 1) + 1) % 1) * high;
    for (const y of [top, top - high]) { // what lies behind is at the bottom and at the top
      const [from, to] = [Math.max(0, Math.round(y)), Math.min(high, Math.round(y + wide * high))];
      if (to > from) pen.fillRect(begin, from, end - begin, to - from);
    }
    pen.globalAlpha = 1;
  }
}
