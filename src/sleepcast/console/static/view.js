// The view: which part of the world is on the screen. World: metres, x to the right, y up. Screen: CSS pixels, y down.

export const UNITS = { m: 1, km: 1000, mi: 1609.344, nmi: 1852, ft: 0.3048, in: 0.0254, cm: 0.01, mm: 0.001, yd: 0.9144 };
const MAX = 4000; // pixels a metre: a scout fills the screen
const FARTHEST = 20; // times farther away than when everything is in sight
const MARGIN = 0.06; // of the screen, left free around what is fitted

export class View {
  constructor() {
    this.x = 0;
    this.y = 0;
    this.scale = 1; // pixels a metre
    this.whole = 1e-6; // the scale at which everything is in sight
    this.width = 1;
    this.height = 1;
  }

  // Another size; the upper left corner stays.
  resize(width, height) {
    const [x, y] = this.toWorld(0, 0);
    this.width = Math.max(1, width);
    this.height = Math.max(1, height);
    this.x = x + this.width / 2 / this.scale;
    this.y = y - this.height / 2 / this.scale;
  }

  // How many times closer than when everything is in sight.
  get closeness() {
    return Math.max(1, this.scale / this.whole);
  }

  toScreenX(x) {
    return (x - this.x) * this.scale + this.width / 2;
  }

  toScreenY(y) {
    return (this.y - y) * this.scale + this.height / 2;
  }

  toWorld(px, py) {
    return [this.x + (px - this.width / 2) / this.scale, this.y - (py - this.height / 2) / this.scale];
  }

  pan(dx, dy) {
    this.x -= dx / this.scale;
    this.y += dy / this.scale;
  }

  // Zoom by a factor; the world point under the pixel (px, py) stays under it.
  zoom(factor, px = this.width / 2, py = this.height / 2) {
    const [x, y] = this.toWorld(px, py);
    this.scale = Math.min(MAX, Math.max(this.whole / FARTHEST, this.scale * factor));
    this.x = x - (px - this.width / 2) / this.scale;
    this.y = y + (py - this.height / 2) / this.scale;
  }

  centre(x, y) {
    this.x = x;
    this.y = y;
  }

  // Show the rectangle [left, bottom, right, top] whole, or only a part of it.
  fit(area, [left, bottom, right, top] = area) {
    this.whole = this.scaleOf(area);
    this.scale = Math.min(MAX, this.scaleOf([left, bottom, right, top]));
    this.centre((left + right) / 2, (bottom + top) / 2);
  }

  scaleOf([left, bottom, right, top]) {
    const free = 1 - 2 * MARGIN;
    return Math.min((this.width * free) / Math.max(right - left, 1e-3), (this.height * free) / Math.max(top - bottom, 1e-3));
  }

  // Whether the rectangle is on the screen, all of it.
  contains([left, bottom, right, top]) {
    const [x, y] = this.toWorld(0, 0);
    const [across, down] = this.toWorld(this.width, this.height);
    return x <= left && across >= right && y >= top && down <= bottom;
  }
}

// How high something is, in a unit of the map's system in which that is a number people read.
export function heightText(metres, unit) {
  const name = { mi: "ft", nmi: "m", km: "m" }[unit] ?? unit;
  return `${+(metres / UNITS[name]).toPrecision(3)} ${name}`;
}

// The round number (1, 2 or 5 times a power of ten) that is nearest below `most`.
export function roundBelow(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  const lead = most / power;
  return (lead >= 5 ? 5 : lead >= 2 ? 2 : 1) * power;
}

// A grid's step for this view in the unit: {metres, label}; lines about `pixels` apart at most.
export function gridStep(view, unit, pixels) {
  let name = unit;
  let most = pixels / view.scale / UNITS[name];
  if (most < 0.1) {
    name = { mi: "ft", nmi: "m", km: "m", yd: "in", ft: "in", m: "cm" }[unit] ?? unit;
    most = pixels / view.scale / UNITS[name];
  }
  const step = roundBelow(most);
  return { metres: step * UNITS[name], label: `${+step.toPrecision(6)} ${name}` };
}
