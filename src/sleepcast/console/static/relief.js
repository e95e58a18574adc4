// How high the ground is where a world has a ground map: its shades on the map, the more ink the higher and the darker the
// slopes that look away from the north-west, and the height of each place, on which other views stand.

import { bytes } from "./accounting.js";
import { groundAt } from "./groundmap.js";

const INK = 0.4; // of 1: the shade of the highest ground, beside
const SLOPES = 0.25; // that of a slope of 1 in 1

export class Relief {
  constructor(world, menu) {
    this.world = world;
    this.menu = menu;
    this.map = null; // as of groundmap.js
    this.sheet = null; // a pixel for each of them
    world.relief = this;
    world.addEventListener("layers", () => world.repaint("ground"));
  }

  setScene({ area, relief }) {
    const line = this.menu.querySelector("#layer-relief")?.closest(".layer");
    if (line) line.hidden = !relief;
    this.area = area;
    this.map = relief ? { ...relief, heights: heightsOf(relief) } : null;
    this.recolour();
  }

  recolour() {
    this.sheet = this.map && this.paint(parts(this.world.colours.ink));
    this.world.repaint("ground");
  }

  // m above the origin, at a place in the world.
  at(x, y) {
    return groundAt(this.area, this.map, x, y);
  }

  paint([red, green, blue]) {
    const { columns, rows, heights, low, high } = this.map;
    const [left, , right] = this.area;
    const step = (right - left) / (columns - 1);
    const image = new ImageData(columns, rows);
    for (let row = 0; row < rows; row += 1) {
      for (let column = 0; column < columns; column += 1) {
        const at = row * columns + column;
        const west = heights[row * columns + Math.max(0, column - 1)];
        const north = heights[Math.min(rows - 1, row + 1) * columns + column];
        const away = Math.max(-1, Math.min(1, (west + north - 2 * heights[at]) / (2 * step)));
        const shade = (INK * (heights[at] - low)) / (high - low || 1) + SLOPES * Math.max(0, away);
        image.data.set([red, green, blue, Math.round(255 * shade)], 4 * ((rows - 1 - row) * columns + column));
      }
    }
    const sheet = new OffscreenCanvas(columns, rows);
    sheet.getContext("2d").putImageData(image, 0, 0);
    return sheet;
  }

  draw(pen, view) {
    if (!this.sheet || !this.world.shows("relief")) return;
    const [left, bottom, right, top] = this.area;
    const { width, height } = this.sheet; // the points at the edge are half a pixel inside
    const place = [view.toScreenX(left), view.toScreenY(top), (right - left) * view.scale, (top - bottom) * view.scale];
    pen.drawImage(this.sheet, 0.5, 0.5, width - 1, height - 1, ...place);
  }
}

function heightsOf({ cells, low, high }) {
  const steps = new DataView(bytes(cells).buffer);
  return Float32Array.from({ length: steps.byteLength / 2 }, (_, at) => low + ((high - low) * steps.getUint16(2 * at, true)) / 65535);
}

const parts = (colour) => [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16));
