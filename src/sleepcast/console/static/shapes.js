// How a robot looks: one shape and one colour for each group, so that neither has to be told by the other alone.

const TURN = 2 * Math.PI;

function polygon(path, x, y, size, angle, corners) {
  for (let i = 0; i < corners; i += 1) {
    const at = angle + (i * TURN) / corners;
    const px = x + size * Math.cos(at);
    const py = y - size * Math.sin(at);
    if (i === 0) path.moveTo(px, py);
    else path.lineTo(px, py);
  }
  path.closePath();
}

// An arrowhead along the heading: a robot in no group.
function arrow(path, x, y, size, heading) {
  const c = Math.cos(heading) * size;
  const s = Math.sin(heading) * size;
  path.moveTo(x + 1.35 * c, y - 1.35 * s);
  path.lineTo(x - 0.9 * c - 0.8 * s, y + 0.9 * s - 0.8 * c);
  path.lineTo(x - 0.45 * c, y + 0.45 * s);
  path.lineTo(x - 0.9 * c + 0.8 * s, y + 0.9 * s + 0.8 * c);
  path.closePath();
}

function disc(path, x, y, size) {
  path.moveTo(x + size, y);
  path.arc(x, y, size, 0, TURN);
}

// The nose of a shape that does not itself point along the heading.
function nose(path, x, y, size, heading) {
  const c = Math.cos(heading) * size;
  const s = Math.sin(heading) * size;
  path.moveTo(x + 0.9 * c, y - 0.9 * s);
  path.lineTo(x + 2.1 * c, y - 2.1 * s);
}

const BODIES = [
  arrow,
  (path, x, y, size) => polygon(path, x, y, 1.35 * size, 0, 4), // diamond
  (path, x, y, size) => polygon(path, x, y, 1.3 * size, TURN / 8, 4), // square
  (path, x, y, size) => disc(path, x, y, 1.05 * size),
  (path, x, y, size) => polygon(path, x, y, 1.3 * size, TURN / 4, 5), // pentagon
  (path, x, y, size) => polygon(path, x, y, 1.45 * size, TURN / 4, 3), // triangle, point up
  (path, x, y, size) => polygon(path, x, y, 1.25 * size, 0, 6), // hexagon
  (path, x, y, size) => polygon(path, x, y, 1.45 * size, -TURN / 4, 3), // triangle, point down
];
export const STYLES = BODIES.length;

// Styles 1..7 serve the groups in turn; 0 is a robot in no group.
export function styleOf(group) {
  return group === 0 ? 0 : ((group - 1) % (STYLES - 1)) + 1;
}

// Add a robot of this style to the path of bodies and, if its shape needs one, its nose to the other path.
export function addRobot(bodies, noses, style, x, y, size, heading) {
  BODIES[style](bodies, x, y, size, heading);
  if (style !== 0) nose(noses, x, y, size, heading);
}

// A small picture of the style, for legends and lists.
export function picture(style, colour, hollow = false) {
  const canvas = document.createElement("canvas");
  const ratio = Math.min(3, window.devicePixelRatio || 1);
  canvas.width = canvas.height = 18 * ratio;
  canvas.className = "shape";
  canvas.setAttribute("aria-hidden", "true");
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.fillStyle = pen.strokeStyle = colour;
  pen.lineWidth = 1.4;
  const bodies = new Path2D();
  BODIES[style](bodies, 9, 9.5, 5.2, TURN / 4);
  if (hollow) pen.stroke(bodies);
  else pen.fill(bodies);
  return canvas;
}

// The colours of the page's theme, for canvases.
export function palette() {
  const css = getComputedStyle(document.documentElement);
  const colour = (name) => css.getPropertyValue(name).trim();
  return {
    ground: colour("--map"),
    area: colour("--map-area"),
    grid: colour("--map-grid"),
    edge: colour("--map-edge"),
    obstacle: colour("--map-obstacle"),
    wall: colour("--map-wall"),
    ink: colour("--ink"),
    quiet: colour("--muted"),
    lit: colour("--lit"),
    chosen: colour("--chosen"),
    place: colour("--place"),
    light: colour("--light"),
    robots: Array.from({ length: STYLES }, (_, style) => colour(`--robot-${style}`)),
  };
}
