// Density: how many robots are where, as a map of heat under them. Counted in squares of the screen and smoothed, so that it
// costs the same however many of the robots lie on one another.

const SIDE = 8; // pixels of a square
const SMOOTHINGS = 3; // passes of a mean over three squares, each way
const STRONGEST = 0.45; // opacity where robots are densest: points are still seen on it
const AGAIN = 250; // ms until robots are counted again, unless the map has moved

export class Density {
  constructor() {
    this.sheet = new OffscreenCanvas(1, 1); // one pixel for each square
    this.key = ""; // of the view and the colour with which it was drawn
    this.next = 0;
  }

  draw(pen, view, frame, colour, now) {
    const across = Math.ceil(view.width / SIDE) + 1;
    const down = Math.ceil(view.height / SIDE) + 1;
    const key = [across, down, view.x, view.y, view.scale, colour].join();
    if (key !== this.key || now >= this.next) {
      this.key = key;
      this.next = now + AGAIN;
      this.count(view, frame, across, down, plain(pen, colour));
    }
    pen.globalCompositeOperation = "destination-over"; // under the robots, which are there already
    pen.drawImage(this.sheet, 0, 0, across * SIDE, down * SIDE);
    pen.globalCompositeOperation = "source-over";
  }

  count(view, frame, across, down, bare) {
    let squares = counted(view, frame, across, down);
    for (let pass = 0; pass < SMOOTHINGS; pass += 1) squares = smoothed(squares, across, down);
    const most = squares.reduce((greatest, number) => Math.max(greatest, number), 0) || 1;
    [this.sheet.width, this.sheet.height] = [across, down];
    const ink = this.sheet.getContext("2d");
    const image = ink.createImageData(across, down);
    const pixels = new Uint32Array(image.data.buffer);
    for (let at = 0; at < squares.length; at += 1) pixels[at] = (Math.round((255 * STRONGEST * squares[at]) / most) << 24) | bare;
    ink.putImageData(image, 0, 0);
  }
}

function counted(view, { poses, count }, across, down) {
  const squares = new Float32Array(across * down);
  const [left, top] = view.toWorld(0, 0);
  const part = view.scale / SIDE;
  for (let i = 0; i < 3 * count; i += 3) {
    const column = Math.floor((poses[i] - left) * part);
    const row = Math.floor((top - poses[i + 1]) * part);
    if (column >= 0 && row >= 0 && column < across && row < down) squares[row * across + column] += 1;
  }
  return squares;
}

// The mean of each square and those around it; nothing lies beyond the edges.
function smoothed(squares, across, down) {
  const rows = new Float32Array(squares.length);
  const smooth = new Float32Array(squares.length);
  for (let row = 0; row < down; row += 1) {
    const first = row * across;
    for (let at = first; at < first + across; at += 1) {
      rows[at] = squares[at] + (at > first ? squares[at - 1] : 0) + (at < first + across - 1 ? squares[at + 1] : 0);
    }
  }
  for (let at = 0; at < squares.length; at += 1) {
    smooth[at] = (rows[at] + (at >= across ? rows[at - across] : 0) + (at < squares.length - across ? rows[at + across] : 0)) / 9;
  }
  return smooth;
}

// A CSS colour as one number in the order of an image's bytes, without its opacity.
function plain(pen, colour) {
  pen.fillStyle = colour; // any colour reads back as #rrggbb
  const number = Number.parseInt(pen.fillStyle.slice(1), 16);
  return ((number & 255) << 16) | (number & 0xff00) | (number >> 16);
}
