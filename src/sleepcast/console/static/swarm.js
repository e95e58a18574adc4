// The robots on the map, in one batch: shapes while those in sight are few enough to tell apart, else
// points in one image, in which robots of groups still have small shapes while there is room for these.

import { CRASHED, SILENT, STILL } from "./frame.js";
import { addRing, addRobot, inkOf, LOOKS, NONE, KINDS } from "./shapes.js";
import { grown } from "./type.js";

export const MAX_SHAPES = 6000; // robots in sight; more become points
const NEAR = 14; // pixels: how far beside a robot a click may be
const MAX_IN_PATH = 100; // robots; what filling a path takes grows faster than what is in it
const OUTSIDE = 30; // pixels beside the map in which a robot may still be seen in part
const DIMMED = 0.5; // opacity of the robots outside the lit ones
const DIMMED_POINTS = 0.3; // the same where robots are points
const LEAST_STAMP = 5; // pixels: the least side at which the shapes of groups are told apart
const LARGEST_STAMP = 9;
const FAINT = 0.35; // opacity of robots that may be elsewhere by now

const SMALLEST = 4.4; // pixels on the smallest window: half a robot's length when everything is in sight
const LARGEST = 26;

// Half a robot's length on the screen, given its radius in m: its true size up to the largest, but never too small to see, and
// a little larger from close by.
function sizeOf(view, radius, largest) {
  return Math.min(largest, Math.max(grown(SMALLEST) * Math.min(2, view.closeness ** 0.25), radius * view.scale));
}

// The same for each robot by its index: how large robots of its kind are on the screen now.
export function sizesOf(view, scene) {
  const sorts = [];
  let count = 0;
  for (const [robots, radius] of scene.sizes) sorts.push({ end: (count += robots), size: sizeOf(view, radius, scene.discs ? Infinity : LARGEST) });
  return (robot) => (sorts.find(({ end }) => robot < end) ?? sorts.at(-1)).size;
}

// Whether at most so many robots are on the screen.
export function few(view, { poses, count }, most) {
  if (count <= most) return true;
  const [left, top] = view.toWorld(-OUTSIDE, -OUTSIDE);
  const [right, bottom] = view.toWorld(view.width + OUTSIDE, view.height + OUTSIDE);
  let seen = 0;
  for (let i = 0; i < 3 * count; i += 3) {
    const [x, y] = [poses[i], poses[i + 1]]; // NaN in a row without a robot
    if (x >= left && x <= right && y >= bottom && y <= top && (seen += 1) > most) return false;
  }
  return true;
}

// The robot nearest to a pixel, within NEAR pixels or its own size: its index, or -1. sizes: as of `sizesOf`.
export function robotAt(view, { poses, count }, sizes, px, py) {
  const [x, y] = view.toWorld(px, py);
  let best = Infinity;
  let nearest = -1;
  for (let i = 0; i < count; i += 1) {
    const dx = poses[3 * i] - x;
    const dy = poses[3 * i + 1] - y;
    const distance = dx * dx + dy * dy;
    const reach = Math.max(NEAR, sizes(i)) / view.scale;
    if (distance < Math.min(best, reach * reach)) [best, nearest] = [distance, i];
  }
  return nearest;
}

// The robot next to another one (an index) in a direction of the screen; the one nearest to the middle of the view if that
// is -1.
export function robotBeside(view, { poses, count }, from, [right, down]) {
  const [x, y] = from < 0 ? [view.x, view.y] : [poses[3 * from], poses[3 * from + 1]];
  let best = Infinity;
  let nearest = from;
  for (let i = 0; i < count; i += 1) {
    if (i === from) continue;
    const dx = poses[3 * i] - x;
    const dy = poses[3 * i + 1] - y;
    const along = dx * right - dy * down;
    const aside = Math.abs(dx * down + dy * right);
    if (from >= 0 && (along <= 0 || aside > along)) continue;
    const distance = Math.hypot(dx, dy) + (from < 0 ? 0 : aside);
    if (distance < best) [best, nearest] = [distance, i];
  }
  return nearest;
}

// Rings round the chosen robot and the one at the pointer.
export function drawRings(pen, view, { poses, count }, sizes, marks, colour) {
  for (const [index, width] of [[marks.pointed, 1.5], [marks.chosen, 2.6]]) {
    if (index < 0 || index >= count) continue;
    pen.beginPath();
    pen.arc(view.toScreenX(poses[3 * index]), view.toScreenY(poses[3 * index + 1]), sizes(index) + 7, 0, 7);
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.stroke();
  }
}

// looks: as of shapes.js. marks: {lit: Uint8Array with 1 for each
// robot that is lit, or null; glow: of 1 how bright; chosen, pointed: indices or -1}
export function drawSwarm(pen, view, scene, frame, looks, marks, colours, ratio) {
  if (few(view, frame, MAX_SHAPES)) drawShapes(pen, view, scene, frame, looks, marks, colours);
  else drawPoints(pen, view, scene, frame, looks, marks, colours, ratio);
  drawCrosses(pen, view, frame, sizesOf(view, scene), colours.bad);
  drawRings(pen, view, frame, sizesOf(view, scene), marks, colours.chosen);
}

// A cross over each robot that has crashed.
function drawCrosses(pen, view, { poses, count, flags }, sizes, colour) {
  const paths = [];
  for (let i = 0; i < count; i += 1) {
    if (!(flags[i] & CRASHED)) continue;
    const [x, y, half] = [view.toScreenX(poses[3 * i]), view.toScreenY(poses[3 * i + 1]), 0.8 * sizes(i) + 1];
    const { cross } = room(paths, () => ({ cross: new Path2D() }));
    for (const side of [-half, half]) {
      cross.moveTo(x - half, y - side);
      cross.lineTo(x + half, y + side);
    }
  }
  pen.strokeStyle = colour;
  pen.lineWidth = 2.2;
  for (const { cross } of paths) pen.stroke(cross);
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
  if (last && last.robots < MAX_IN_PATH) {
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

// The pixels of the screen that each robot would have if all had as many.
function roomOf(view, scene, count, ratio) {
  const [left, bottom, right, top] = scene.area;
  return ((right - left) * (top - bottom) * (view.scale * ratio) ** 2) / count;
}

let image = null; // kept between frames: a screenful of pixels

function drawPoints(pen, view, scene, frame, looks, marks, colours, ratio) {
  const { width, height } = pen.canvas;
  if (image?.width !== width || image.height !== height) image = pen.createImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);
  pixels.fill(0);
  const room = roomOf(view, scene, frame.count, ratio);
  const size = Math.min(3, Math.max(1, Math.round(Math.sqrt(room / 6)))); // points leave most of the area free
  const plain = Math.min(2, size); // of robots that look like their kind
  const side = Math.min(LARGEST_STAMP, Math.floor(Math.sqrt(room) / ratio)) * ratio;
  const stamps = side >= LEAST_STAMP * ratio ? stampsOf(Math.round(side)) : null;
  const { bodies } = looks;
  const put = (i, more, ink) => {
    const x = Math.round(view.toScreenX(frame.poses[3 * i]) * ratio);
    const y = Math.round(view.toScreenY(frame.poses[3 * i + 1]) * ratio);
    const stamp = bodies[i] < KINDS ? null : stamps?.(bodies[i]);
    const long = stamp ? stamp.side : (bodies[i] < KINDS ? plain : size) + more;
    const [left, top] = stamp ? [x - (long >> 1), y - (long >> 1)] : [x, y];
    if (left < 0 || top < 0 || left + long > width || top + long > height) return;
    const first = top * width + left;
    if (stamp) for (const [across, down] of stamp.dots) pixels[first + down * width + across] = ink;
    else for (let row = first; row < first + long * width; row += width) pixels.fill(ink, row, row + long);
  };
  const dim = marks.lit ? 1 - (1 - DIMMED_POINTS) * marks.glow : 1;
  const inks = Array.from({ length: LOOKS }, (_, look) => packed(pen, colours.robots[inkOf(look)], dim));
  for (let i = 0; i < frame.count; i += 1) put(i, 0, inks[bodies[i]]);
  if (marks.lit) {
    const bright = packed(pen, colours.lit);
    for (let i = 0; i < frame.count; i += 1) if (marks.lit[i] === 1) put(i, 1, bright);
  }
  pen.putImageData(image, 0, 0);
}

let stamps = { side: 0, known: new Map() }; // of the size that was wanted last

// Gives, for a look, its body as the pixels of a small picture: {side, dots: [across, down] each}.
function stampsOf(side) {
  if (stamps.side !== side) stamps = { side, known: new Map() };
  return (look) => {
    if (!stamps.known.has(look)) stamps.known.set(look, stampOf(look, side));
    return stamps.known.get(look);
  };
}

function stampOf(look, side) {
  const pen = new OffscreenCanvas(side, side).getContext("2d");
  const body = new Path2D();
  addRobot(body, new Path2D(), look, side / 2, side / 2, side / 2.7, 0);
  pen.fill(body);
  const { data } = pen.getImageData(0, 0, side, side);
  const dots = [];
  for (let at = 0; at < side * side; at += 1) if (data[4 * at + 3] > 127) dots.push([at % side, Math.floor(at / side)]);
  return { side, dots };
}

const packedColours = new Map();

// A CSS colour as one number in the order of an image's bytes. alpha: of 1.
function packed(pen, colour, alpha = 1) {
  if (!packedColours.has(colour)) {
    pen.fillStyle = colour; // any colour reads back as #rrggbb
    const number = Number.parseInt(pen.fillStyle.slice(1), 16);
    const [red, green, blue] = [number >> 16, (number >> 8) & 255, number & 255];
    packedColours.set(colour, (blue << 16) | (green << 8) | red);
  }
  return ((Math.round(255 * alpha) << 24) | packedColours.get(colour)) >>> 0;
}
