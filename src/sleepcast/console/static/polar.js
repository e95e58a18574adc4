// A ring of sensors seen from above, the front up: sonars as sectors that reach as far as they measured, infrared sensors
// as bars that grow with what is near, and where a bumper is hit.

const TURN = 2 * Math.PI;
const FRONT = -TURN / 4; // on the screen

// Sonars. sheet: {pen, width, height}. readings: what each measured in m, from the front counter-clockwise, null for
// nothing. farthest: m, what they read where there is nothing. rings: m, circles for the eye. colour: of the sectors.
// shown: whether the sectors are. text(m): how people read a range. Gives the readings in words.
export function drawSonars({ pen, width, height }, { readings, farthest, rings, colour, colours, shown = true, text }) {
  const [x, y] = [width / 2, height / 2];
  const most = Math.min(width, height) / 2 - 16;
  const away = (range) => most * Math.sqrt(Math.min(range, farthest) / farthest); // what is near counts most
  pen.strokeStyle = colours.grid;
  pen.lineWidth = 1;
  for (const ring of rings) circle(pen, x, y, away(ring));
  const half = Math.PI / readings.length;
  pen.font = "600 11px system-ui, sans-serif";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  readings.forEach((range, sonar) => {
    const middle = FRONT - (TURN * sonar) / readings.length;
    const heard = shown && range !== null && range < farthest;
    if (heard) {
      pen.beginPath();
      pen.moveTo(x, y);
      pen.arc(x, y, away(range), middle - half + 0.02, middle + half - 0.02);
      pen.closePath();
      pen.fillStyle = colour;
      pen.globalAlpha = 0.3;
      pen.fill();
      pen.globalAlpha = 1;
      pen.lineWidth = 1.5;
      pen.strokeStyle = colour;
      pen.stroke();
    }
    pen.fillStyle = heard ? colours.ink : colours.quiet;
    pen.fillText(range === null ? "–" : text(range), x + (most + 9) * Math.cos(middle), y + (most + 7) * Math.sin(middle));
  });
  nose(pen, x, y, 7, colours.ink);
  return readings.map((range) => (range === null ? "none" : text(range))).join(", ");
}

// A bumper. touched: the directions of what it touches, rad from the front counter-clockwise. infrared: what each such
// sensor measured in m, null for nothing; sight: m, what they see at most. none: words where there are no such sensors.
// shown: {bumper, infrared}. Gives what is hit in words.
export function drawBumper({ pen, width, height }, { touched, infrared, sight, colours, shown, none = "" }) {
  const [x, y] = [width / 2, height / 2];
  const size = Math.min(width, height) / 2 - 30;
  if (shown.infrared) drawInfrared(pen, [x, y, size], infrared, sight, colours);
  pen.strokeStyle = colours.edge;
  pen.lineWidth = 6;
  circle(pen, x, y, size);
  pen.lineWidth = 10;
  pen.strokeStyle = colours.place;
  for (const angle of shown.bumper ? touched : []) {
    pen.beginPath();
    pen.arc(x, y, Math.max(0, size), FRONT - angle - 0.22, FRONT - angle + 0.22);
    pen.stroke();
  }
  nose(pen, x, y - size + 20, 7, colours.quiet);
  const degrees = touched.map((angle) => `${Math.round((angle * 360) / TURN)}°`);
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillStyle = degrees.length ? colours.place : colours.quiet;
  pen.font = `${degrees.length ? 700 : 400} 13px system-ui, sans-serif`;
  pen.fillText(degrees.length ? `hit at ${degrees[0]}` : "free", x, y);
  pen.fillStyle = colours.quiet;
  pen.font = "11px system-ui, sans-serif";
  if (!infrared.length) pen.fillText(none, x, height - 9);
  return degrees.length ? `hit at ${degrees.join(", ")} from the front` : "free";
}

function drawInfrared(pen, [x, y, size], infrared, sight, colours) {
  pen.lineWidth = 4;
  infrared.forEach((range, sensor) => {
    const near = range === null ? 0 : 1 - Math.min(range, sight) / sight;
    const angle = FRONT - (TURN * sensor) / infrared.length;
    const length = 3 + 21 * near;
    pen.beginPath();
    pen.moveTo(x + (size + 5) * Math.cos(angle), y + (size + 5) * Math.sin(angle));
    pen.lineTo(x + (size + 5 + length) * Math.cos(angle), y + (size + 5 + length) * Math.sin(angle));
    pen.strokeStyle = near > 0 ? colours.lit : colours.grid;
    pen.stroke();
  });
}

// A canvas made fit for what it shows, and cleared.
export function sheet(canvas) {
  const { width, height } = canvas.getBoundingClientRect();
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  const [across, up] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== across || canvas.height !== up) [canvas.width, canvas.height] = [across, up];
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}

function circle(pen, x, y, size) {
  pen.beginPath();
  pen.arc(x, y, Math.max(0, size), 0, TURN);
  pen.stroke();
}

// A small arrowhead that points to the front.
function nose(pen, x, y, size, colour) {
  pen.beginPath();
  pen.moveTo(x, y - size);
  pen.lineTo(x + 0.7 * size, y + 0.7 * size);
  pen.lineTo(x, y + 0.3 * size);
  pen.lineTo(x - 0.7 * size, y + 0.7 * size);
  pen.closePath();
  pen.fillStyle = colour;
  pen.fill();
}
