// The robots on the map, in one batch: shapes while those in sight are few enough to tell apart, else points in one image.

import { SILENT, STILL } from "./frame.js";
import { addRing, addRobot, inkOf, LOOKS, NONE, SORTS } from "./shapes.js";

export const MOST_SHAPES = 6000; // robots in sight; more become points
const MOST_IN_PATH = 100; // robots; what filling a path takes grows faster than what is in it
const OUTSIDE = 30; // pixels beside the map in which a robot may still be seen in part
const DIMMED = 0.5; // opacity of the robots outside the lit ones
const FAINT = 0.35; // opacity of robots that may be elsewhere by now

const SMALLEST = 4.4; // pixels: half a robot's length when everything is in sight
const LARGEST = 26;

// Half a robot's length on the screen, given its radius in m: its true size, but never too small to see, and a little
// larger from close by.
function sizeOf(view, radius) {
  return Math.min(LARGEST, Math.max(SMALLEST * Math.min(2, view.closeness ** 0.25), radius * view.scale));
}

// The same for each robot by its index: how large robots of its sort are on the screen now.
export function sizesOf(view, scene) {
  const sorts = [];
  let count = 0;
  for (const [robots, radius] of scene.sizes) sorts.push({ end: (count += robots), size: sizeOf(view, radius) });
  return (robot) => (sorts.find(({ end }) => robot < end) ?? sorts.at(-1)).size;
}

// Whether at most so many robots are on the screen.
export function few(view, { poses, count }, most) {
  if (count <= most) return true;
  const [left, top] = view.toWorld(-OUTSIDE, -OUTSIDE);
  const [right, bottom] = view.toWorld(view.width + OUTSIDE, view.height + OUTSIDE);
  let seen = 0;
  for (let i = 0; i < 3 * count; i += 3) {
    if (poses[i] < left || poses[i] > right || poses[i + 1] > top || poses[i + 1] < bottom) continue;
    if ((seen += 1) > most) return false;
  }
  return true;
}

// looks: as of shapes.js. marks: {lit: Uint8Array with 1 for each
// robot that is lit, or null; glow: of 1 how bright; chosen, pointed: indices or -1}
export function drawSwarm(pen, view, scene, frame, looks, marks, colours, ratio) {
  if (few(view, frame, MOST_SHAPES)) drawShapes(pen, view, scene, frame, looks, marks, colours);
  else drawPoints(pen, view, scene, frame, looks, marks, colours, ratio);
  const sizes = sizesOf(view, scene);
  for (const [index, width] of [[marks.pointed, 1.5], [marks.chosen, 2.6]]) {
    if (index < 0 || index >= frame.count) continue;
    pen.beginPath();
    pen.arc(view.toScreenX(frame.poses[3 * index]), view.toScreenY(frame.poses[3 * index + 1]), sizes(index) + 7, 0, 7);
    pen.strokeStyle = colours.chosen;
    pen.lineWidth = width;
    pen.stroke();
  }
}

function drawShapes(pen, view, scene, frame, looks, marks, colours) {
  const sizes = sizesOf(view, scene);
  const halos = [];
  const buckets = new Map();
  const rings = new Map(); // by look
  for (let i = 0; i < frame.count; i += 1) {
    const x = view.toScreenX(frame.poses[3 * i]);
    const y = view.toScreenY(frame.poses[3 * i + 1]);
    if (x < -OUTSIDE || y < -OUTSIDE || x > view.width + OUTSIDE || y > view.height + OUTSIDE) continue;
    const size = sizes(i);
    const lit = marks.lit?.[i] === 1;
    if (lit) {
      const { halo } = room(halos, () => ({ halo: new Path2D() }));
      halo.moveTo(x + size + 4.5, y);
      halo.arc(x, y, size + 4.5, 0, 2 * Math.PI);
    }
    const look = looks.bodies[i];
    const flags = frame.flags[i];
    const key = look + LOOKS * ((flags & STILL ? 1 : 0) + (lit ? 2 : 0) + (flags & SILENT ? 4 : 0));
    if (!buckets.has(key)) buckets.set(key, []);
    const { bodies, noses } = room(buckets.get(key), () => ({ bodies: new Path2D(), noses: new Path2D() }));
    addRobot(bodies, noses, look, x, y, size, frame.poses[3 * i + 2] || 0); // NaN: it stands aside
    const ring = looks.rings ? looks.rings[i] : NONE;
    if (ring === NONE) continue;
    if (!rings.has(ring)) rings.set(ring, []);
    addRing(room(rings.get(ring), () => ({ path: new Path2D() })).path, ring, x, y, size);
  }
  drawHalos(pen, halos, colours.lit, marks.glow);
  for (const key of [...buckets.keys()].sort((a, b) => a - b)) {
    const ink = inkOf(key % LOOKS);
    const how = Math.floor(key / LOOKS);
    const lit = (how & 2) !== 0;
    pen.globalAlpha = how & 4 ? FAINT : marks.lit && !lit && ink === 0 ? 1 - (1 - DIMMED) * marks.glow : 1;
    pen.strokeStyle = pen.fillStyle = lit && ink === 0 ? colours.ink : colours.robots[ink];
    pen.lineWidth = 1.4;
    for (const { bodies, noses } of buckets.get(key)) {
      pen.stroke(noses);
      if (how & 1) pen.stroke(bodies);
      else pen.fill(bodies);
    }
  }
  pen.globalAlpha = 1;
  pen.lineWidth = 1.1;
  for (const [look, paths] of rings) {
    pen.strokeStyle = colours.robots[inkOf(look)];
    for (const { path } of paths) pen.stroke(path);
  }
}

// The last of these paths if there is room in it for one more robot, else a new one.
function room(paths, begin) {
  const last = paths.at(-1);
  if (last && last.robots < MOST_IN_PATH) {
    last.robots += 1;
    return last;
  }
  const next = { ...begin(), robots: 1 };
  paths.push(next);
  return next;
}

function drawHalos(pen, halos, colour, glow) {
  pen.fillStyle = pen.strokeStyle = colour;
  pen.lineWidth = 1.8;
  for (const { halo } of halos) {
    pen.globalAlpha = 0.3 * glow;
    pen.fill(halo);
  }
  pen.globalAlpha = glow;
  for (const { halo } of halos) pen.stroke(halo);
  pen.globalAlpha = 1;
}

// The side of a robot's point, in pixels of the screen: 1 to 3, so that robots all over the area leave most of it free.
function pointSize(view, scene, count, ratio) {
  const [left, bottom, right, top] = scene.area;
  const room = ((right - left) * (top - bottom) * (view.scale * ratio) ** 2) / count;
  return Math.min(3, Math.max(1, Math.round(Math.sqrt(room / 6))));
}

let image = null; // kept between frames: a screenful of pixels

function drawPoints(pen, view, scene, frame, looks, marks, colours, ratio) {
  const { width, height } = pen.canvas;
  if (image?.width !== width || image.height !== height) image = pen.createImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);
  pixels.fill(0);
  const inks = Array.from({ length: LOOKS }, (_, look) => packed(pen, colours.robots[inkOf(look)]));
  const dot = (i, side, ink) => {
    const x = Math.round(view.toScreenX(frame.poses[3 * i]) * ratio);
    const y = Math.round(view.toScreenY(frame.poses[3 * i + 1]) * ratio);
    if (x < 0 || y < 0 || x + side > width || y + side > height) return;
    for (let row = y * width + x; row < (y + side) * width + x; row += width) pixels.fill(ink, row, row + side);
  };
  const size = pointSize(view, scene, frame.count, ratio);
  const { bodies } = looks;
  const plain = Math.min(2, size); // of robots that look like their sort
  for (let i = 0; i < frame.count; i += 1) dot(i, bodies[i] < SORTS ? plain : size, inks[bodies[i]]);
  if (marks.lit) {
    const bright = packed(pen, colours.lit);
    for (let i = 0; i < frame.count; i += 1) if (marks.lit[i] === 1) dot(i, size + 1, bright);
  }
  pen.putImageData(image, 0, 0);
}

const packedColours = new Map();

// A CSS colour as one number in the order of an image's bytes.
function packed(pen, colour) {
  if (!packedColours.has(colour)) {
    pen.fillStyle = colour; // any colour reads back as #rrggbb
    const number = Number.parseInt(pen.fillStyle.slice(1), 16);
    const [red, green, blue] = [number >> 16, (number >> 8) & 255, number & 255];
    packedColours.set(colour, ((255 << 24) | (blue << 16) | (green << 8) | red) >>> 0);
  }
  return packedColours.get(colour);
}
