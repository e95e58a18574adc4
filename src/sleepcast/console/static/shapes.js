// How robots look: a body of some shape and some colour, perhaps with a spot, and perhaps a ring around it.
//
// Groups take the seven shapes and the seven colours in turn; after each round the colours are shifted by one, and every
// other round has a spot, so that no two of 49 look alike and 14 differ without any colour. What robots show with COLOUR
// takes the same shapes and colours in another order, and with the spot where groups have none. A robot without either
// looks like its kind, and points along its heading. api/looks.py has the same for pictures without a page.

const TURN = 2 * Math.PI;
const SHAPES = 7;
const ROUNDS = 7; // of all shapes, until the first look comes again
export const KINDS = 8; // looks of kinds of robots; those of groups follow, then those of colours
const PAIRS = ROUNDS * SHAPES;
const SECOND_NEUTRAL = 8; // the colour of every other kind; 0 is that of the rest, 1 to 7 are those of groups
const DISCS = KINDS + 2 * PAIRS; // looks of bodies that are told apart by their colours alone
export const LOOKS = DISCS + SHAPES;
export const NONE = 255; // no ring
const MAX_COLOURS = 14; // different ones shown at one time; more are names rather than kinds, and nobody tells them apart

// Bodies of sorts: corners as parts of the size, forwards and to the left.
const ARROW = [[1.35, 0], [-0.9, 0.8], [-0.45, 0], [-0.9, -0.8]];
const HOUSE = [[1.35, 0], [0.35, 0.8], [-1, 0.8], [-1, -0.8], [0.35, -0.8]];
const TEE = [[1.3, 0.3], [-0.2, 0.3], [-0.2, 1.1], [-0.9, 1.1], [-0.9, -1.1], [-0.2, -1.1], [-0.2, -0.3], [1.3, -0.3]];
const CHEVRON = [[1.2, 0], [-0.6, 1.15], [-1.2, 0.75], [-0.1, 0], [-1.2, -0.75], [-0.6, -1.15]];

// Bodies of groups: how many corners they have (0: a disc), the first corner's angle, and their size.
const BODIES = [
  [4, 0, 1.35], // diamond
  [4, TURN / 8, 1.3], // square
  [0, 0, 1.05],
  [5, TURN / 4, 1.3],
  [3, TURN / 4, 1.45], // triangle, point up
  [6, 0, 1.25],
  [3, -TURN / 4, 1.45], // triangle, point down
];
const SPOT = 0.5; // the radius of the spot, as a part of the size

function ofKind(kind) {
  const shape = kind % 4;
  return { corners: [ARROW, HOUSE, TEE, CHEVRON][shape], ink: (kind + Math.floor(kind / 4)) % 2 ? SECOND_NEUTRAL : 0 };
}

function ofPair(number, shift, spot) {
  const shape = number % SHAPES;
  return { shape, ink: 1 + ((shape + shift) % SHAPES), spot };
}

const round = (number) => Math.floor(number / SHAPES);
const all = [
  ...Array.from({ length: KINDS }, (_, kind) => ofKind(kind)),
  ...Array.from({ length: PAIRS }, (_, n) => ofPair(n, round(n), round(n) % 2 === 1)),
  ...Array.from({ length: PAIRS }, (_, n) => ofPair(n, ROUNDS - 1 - round(n), round(n) % 2 === 0)),
  ...Array.from({ length: SHAPES }, (_, n) => ({ shape: 2, ink: 1 + n, spot: false })),
];

export const lookOfKind = (kind) => kind % KINDS;
export const lookOfGroup = (code) => KINDS + ((code - 1) % PAIRS); // codes are counted from 1
export const lookOfColour = (number) => KINDS + PAIRS + ((number - 1) % PAIRS);
export const inkOf = (look) => all[look].ink;

// The same by number, for many robots: 0 is no group, and no colour.
const GROUPS = Uint8Array.from({ length: 256 }, (_, code) => (code ? lookOfGroup(code) : 0));
const COLOURS = Uint8Array.from({ length: 256 }, (_, number) => (number ? lookOfColour(number) : 0));
const INKS = Uint8Array.from(all, ({ ink }) => ink);

// The kind of each robot, as a look. sizes: how many robots each kind has, as in a scene.
export function sortsOf(sizes, count) {
  const looks = new Uint8Array(count);
  let first = 0;
  sizes.forEach(([robots], kind) => {
    looks.fill(lookOfKind(kind), first, (first += robots));
  });
  return looks;
}

// Nomads: each a disc of its own colour, in turn.
export const discsOf = (count) => Uint8Array.from({ length: count }, (_, robot) => DISCS + (robot % SHAPES));
export const colourOf = (robot, colours) => colours.robots[1 + (robot % SHAPES)];

// How many robots show each colour, by its number; none where too many different ones are shown to be looks.
export function colourCounts({ colours }) {
  const counts = new Array(256).fill(0);
  for (const colour of colours ?? []) counts[colour] += 1;
  const different = counts.filter((count, colour) => colour && count).length;
  return different <= MAX_COLOURS ? counts : [];
}

// The looks of all robots: their bodies, and their rings (NONE for who has none) or null where nobody has one. The body is that
// of the newest group, else of the colour, else of the kind; the ring is that of the second group, else of the colour of who
// is in a group.
export function looksOf(frame, sorts) {
  const { count, groups, second } = frame;
  const colours = frame.colours && colourCounts(frame).length ? frame.colours : null;
  const bodies = new Uint8Array(count);
  const rings = second || colours ? new Uint8Array(count).fill(NONE) : null;
  for (let i = 0; i < count; i += 1) {
    const shown = colours ? COLOURS[colours[i]] : 0;
    bodies[i] = GROUPS[groups[i]] || shown || sorts[i];
    if (!rings || !groups[i]) continue;
    rings[i] = (second && GROUPS[second[i]]) || shown || NONE;
  }
  return { bodies, rings };
}

// The colours of these looks, as places in the palette's `robots`.
export const inksOf = (looks) => looks.map((look) => INKS[look]);

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

function pointed(path, x, y, size, heading, corners) {
  const c = Math.cos(heading) * size;
  const s = Math.sin(heading) * size;
  corners.forEach(([a, b], i) => {
    const px = x + a * c - b * s;
    const py = y - a * s - b * c;
    if (i === 0) path.moveTo(px, py);
    else path.lineTo(px, py);
  });
  path.closePath();
}

function outline(path, shape, x, y, size) {
  const [corners, angle, part] = BODIES[shape];
  if (corners) polygon(path, x, y, part * size, angle, corners);
  else {
    path.moveTo(x + part * size, y);
    path.arc(x, y, part * size, 0, TURN, true); // the other way round than the spot, which is left out of it
  }
}

// The nose of a body that does not itself point along the heading.
function nose(path, x, y, size, heading) {
  const c = Math.cos(heading) * size;
  const s = Math.sin(heading) * size;
  path.moveTo(x + 0.9 * c, y - 0.9 * s);
  path.lineTo(x + 2.1 * c, y - 2.1 * s);
}

// Add a robot of this look to the path of bodies and, if it needs one, its nose to the other path.
export function addRobot(bodies, noses, look, x, y, size, heading) {
  const { corners, shape, spot } = all[look];
  if (corners) {
    pointed(bodies, x, y, size, heading, corners);
    return;
  }
  outline(bodies, shape, x, y, size);
  if (spot) {
    bodies.moveTo(x + SPOT * size, y);
    bodies.arc(x, y, SPOT * size, 0, TURN);
  }
  nose(noses, x, y, size, heading);
}

// Add the ring around a robot: the outline of the look's body, wider than any body.
export function addRing(path, look, x, y, size) {
  outline(path, all[look].shape, x, y, 1.6 * size + 1.8);
}

// A small picture of the look, for legends and lists. ring: the look of the ring, if there is one.
export function picture(look, colours, ring = NONE) {
  const canvas = document.createElement("canvas");
  const ratio = Math.min(3, window.devicePixelRatio || 1);
  canvas.width = canvas.height = 18 * ratio;
  canvas.className = "shape";
  canvas.setAttribute("aria-hidden", "true");
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.fillStyle = colours.robots[inkOf(look)];
  const bodies = new Path2D();
  addRobot(bodies, new Path2D(), look, 9, 9.5, ring === NONE ? 5.2 : 3, TURN / 4);
  pen.fill(bodies);
  if (ring === NONE) return canvas;
  pen.strokeStyle = colours.robots[inkOf(ring)];
  pen.lineWidth = 1.4;
  const around = new Path2D();
  addRing(around, ring, 9, 9.5, 3);
  pen.stroke(around);
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
    bad: colour("--bad"),
    lit: colour("--lit"),
    chosen: colour("--chosen"),
    place: colour("--place"),
    light: colour("--light"),
    density: colour("--density"),
    field: Array.from({ length: 5 }, (_, step) => colour(`--field-${step}`)),
    robots: Array.from({ length: SECOND_NEUTRAL + 1 }, (_, ink) => colour(`--robot-${ink}`)),
  };
}
