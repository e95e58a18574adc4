// Density: how many robots are where, as a map of heat under them. Counted in squares of the screen and smoothed, so that it
// costs the same however many of the robots lie on one another.

const SIDE = 8; // pixels of a square
const SMOOTHINGS = 3; // passes of a mean over three squares, each way
const STRONGEST = 0.75; // opacity where robots are densest

let sheet = null; // one pixel for each square; kept between frames

export function drawDensity(pen, view, { poses, count }, colour) {
  const across = Math.ceil(view.width / SIDE) + 1;
  const down = Math.ceil(view.height / SIDE) + 1;
  let squares = new Float32Array(across * down);
  for (let i = 0; i < count; i += 1) {
    const column = Math.floor(view.toScreenX(poses[3 * i]) / SIDE);
    const row = Math.floor(view.toScreenY(poses[3 * i + 1]) / SIDE);
    if (column >= 0 && row >= 0 && column < across && row < down) squares[row * across + column] += 1;
  }
  for (let pass = 0; pass < SMOOTHINGS; pass += 1) squares = smooth(smooth(squares, across, down, 1), across, down, across);
  const most = squares.reduce((found, number) => Math.max(found, number), 0);
  if (most === 0) return;
  if (sheet?.width !== across || sheet.height !== down) sheet = new OffscreenCanvas(across, down);
  const ink = sheet.getContext("2d");
  const image = ink.createImageData(across, down);
  const [red, green, blue] = parts(pen, colour);
  for (let at = 0; at < squares.length; at += 1) {
    image.data[4 * at] = red;
    image.data[4 * at + 1] = green;
    image.data[4 * at + 2] = blue;
    image.data[4 * at + 3] = 255 * STRONGEST * Math.sqrt(squares[at] / most);
  }
  ink.putImageData(image, 0, 0);
  pen.imageSmoothingEnabled = true;
  pen.drawImage(sheet, 0, 0, across * SIDE, down * SIDE);
}

// The mean of each square and its two neighbours, `step` places before and behind it.
function smooth(squares, across, down, step) {
  const found = new Float32Array(squares.length);
  for (let at = 0; at < squares.length; at += 1) {
    const edge = step === 1 ? [at % across === 0, at % across === across - 1] : [at < across, at >= across * (down - 1)];
    found[at] = (squares[at] + (edge[0] ? 0 : squares[at - step]) + (edge[1] ? 0 : squares[at + step])) / 3;
  }
  return found;
}

function parts(pen, colour) {
  pen.fillStyle = colour; // any colour reads back as #rrggbb
  const number = Number.parseInt(pen.fillStyle.slice(1), 16);
  return [number >> 16, (number >> 8) & 255, number & 255];
}
