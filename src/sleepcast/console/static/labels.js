// The names on the map: of places, lights, areas, groups and robots; and how high obstacles are. No two lie over each other. The farther away one is, the
// fewer robots have theirs; those that had it keep it while there is room, so that nothing flickers as one moves the map.
// Among few robots a name hides none: it stands beside its robot, or above it.

import { GLOW } from "./ground.js";
import { inkOf, lookOfGroup } from "./shapes.js";
import { font as fontOf, grown } from "./type.js";
import { heightText } from "./view.js";

const ALL = 45; // robots in sight that may all have their names
const THINNING = 0.6; // with 10 times as many in sight, a quarter as many of them have their names
const SLACK = 1.15; // names beyond that go only when there are so many times as many
const GAP = 6; // pixels around a name that comes; one that is there needs none
const HALF = 9; // pixels: half a name's height
const TOGETHER = 90; // pixels: a group whose robots are farther from its middle has no place for a name
const CODES = 256; // of groups in a frame; 0 is none
const MAX = 6000; // robots in sight; with more, only the chosen one has its name

const FONTS = { place: [13, 600], light: [13, 600], area: [12, 600], tall: [11], group: [12, 600], chosen: [12, 600], robot: [11], answer: [12, 600] }; // size and weight

export class Labels {
  constructor() {
    this.sprites = new Sprites();
    this.shown = new Map(); // robots that have their names, and whether these stand above them
    this.names = null; // those of the scene that `shown` is of
    this.heights = []; // of obstacles, as of `heightsOf`
    this.solid = null; // the obstacles that these are of
  }

  // what: {scene, frame, marks, colours, ratio, sizes: as of swarm.js, picked: 1 for each selected robot, robots: whether these and
  // groups have names, all but the chosen one, replies: what each robot answered, as of replies.js, or null,
  // covered: boxes, as of world.js, where nobody would see a name}
  draw(pen, view, what) {
    const labels = this.arrange(view, what, (text, font) => this.sprites.width(text, font));
    this.sprites.draw(pen, labels, what.colours, what.ratio);
  }

  // The names that are seen, and where: {text, font, colour, x, y}. width: gives that of a text, in pixels.
  arrange(view, what, width) {
    const { scene, frame, marks, colours } = what;
    if (scene.names !== this.names) this.shown.clear();
    this.names = scene.names;
    const labels = [];
    const half = grown(HALF);
    const boxes = [...(what.covered ?? [])]; // and left, top, right, bottom of each name that is there, in turn
    const put = (text, kind, colour, x, y, gap) => {
      const font = fontOf(...FONTS[kind]);
      const right = x + width(text, font);
      if (right < 0 || x > view.width || y + half < 0 || y - half > view.height) return false;
      if (hits(boxes, x - 2 - gap, y - half - gap, right + 2 + gap, y + half + gap)) return false;
      boxes.push(x - 2, y - half, right + 2, y + half);
      labels.push({ text, font, colour, x, y });
      return true;
    };
    const pixels = (i) => [view.toScreenX(frame.poses[3 * i]), view.toScreenY(frame.poses[3 * i + 1])];
    // Gives whether the name stands above the robot; null if there is no room. above: where it stood. others: robots that it must
    // not hide; only an answer may.
    const robot = (i, kind, colour, gap, above = false, others = []) => {
      const answer = what.replies?.of(i);
      const text = [...(what.robots || kind === "chosen" ? [scene.names[i]] : []), ...(answer ? [answer] : [])].join("  ");
      if (!text) return null;
      const look = answer ? ["answer", colours.ink] : [kind, colour];
      const [x, y, wide] = [...pixels(i), width(text, fontOf(...FONTS[look[0]]))];
      const seen = answer ? [] : others;
      const hides = (left, middle) => seen.some((j) => j !== i && lies(...pixels(j), what.sizes(j), left, middle, wide, half));
      for (const up of seen.length || kind === "chosen" ? [above, !above] : [false]) {
        const at = up ? [x - wide / 2, y - what.sizes(i) - half - 2] : [x + what.sizes(i) + 9, y];
        if (!hides(...at) && put(text, ...look, ...at, gap)) return up;
      }
      return null;
    };

    const { chosen } = marks;
    if (chosen >= 0 && chosen < frame.count) robot(chosen, "chosen", colours.ink, 0);
    for (const { name, x, y } of scene.places) put(name, "place", colours.place, view.toScreenX(x) + 17, view.toScreenY(y), 0);
    for (const { name, x, y } of scene.lights) put(name, "light", colours.ink, view.toScreenX(x) + 10, view.toScreenY(y) - 0.75 * GLOW, 0);
    for (const area of scene.areas) put(area.name, "area", colours.place, ...cornerOf(view, area), 0);
    if (what.robots || what.replies) this.nameRobots(view, what, robot, put, width);
    else this.shown.clear();
    this.writeHeights(view, scene, colours, put, width);
    return labels;
  }

  // Obstacles that are wide enough on the screen say how high they are.
  writeHeights(view, scene, colours, put, width) {
    if (scene.obstacles !== this.solid) {
      this.solid = scene.obstacles;
      this.heights = heightsOf(scene);
    }
    for (const { text, x, y, size } of scene.tall?.length ? this.heights : []) {
      const wide = width(text, fontOf(...FONTS.tall));
      if (size * view.scale > wide + 2 * GAP) put(text, "tall", colours.quiet, view.toScreenX(x) - wide / 2, view.toScreenY(y), 0);
    }
  }

  nameRobots(view, what, robot, put, width) {
    const { scene, frame, colours } = what;
    for (const { code, x, y } of what.robots ? middles(view, frame) : []) {
      const group = scene.groups?.[code - 1];
      if (group) put(group.name, "group", colours.robots[inkOf(lookOfGroup(code))], x - width(group.name, FONTS.group) / 2, y, 0);
    }
    this.shown = this.some(view, what, robot);
  }

  // Give robots their names: first who is pointed at or selected, then who had one, then others by their number.
  some(view, { frame, marks, picked, colours }, robot) {
    const seen = inSight(view, frame, MAX);
    if (!seen) return new Map();
    const few = seen.length <= ALL ? seen : []; // whom no name may hide
    const most = Math.max(1, Math.floor(seen.length <= ALL ? ALL : ALL * (ALL / seen.length) ** THINNING));
    const now = new Map();
    const give = (i, limit, gap, others) => {
      if (now.size >= limit || i === marks.chosen || now.has(i)) return;
      const above = robot(i, "robot", colours.quiet, gap, this.shown.get(i), others);
      if (above !== null) now.set(i, above);
    };
    const first = (i) => i === marks.pointed || picked?.[i] === 1;
    for (const i of seen) if (first(i)) give(i, SLACK * most, this.shown.has(i) ? 0 : GAP, []);
    for (const i of seen) if (this.shown.has(i)) give(i, SLACK * most, 0, few);
    for (const i of seen) {
      if (now.size >= most) break;
      give(i, most, GAP, few);
    }
    return now;
  }
}

// Whether a robot lies under a name, both in pixels: the middle of the robot, and the left end and the middle of the name.
function lies(x, y, size, left, middle, wide, half) {
  return x + size > left - 2 && x - size < left + wide + 2 && Math.abs(y - middle) < half + size;
}

// Of obstacles with a limited height, this as a text, their middles, and their longer sides, m.
function heightsOf({ obstacles, tall, unit }) {
  return obstacles.flatMap((outlines, index) => {
    if (tall?.[index] == null) return [];
    const [xs, ys] = [0, 1].map((axis) => outlines.flat().map((corner) => corner[axis]));
    const [left, right, bottom, top] = [least(xs), most(xs), least(ys), most(ys)];
    const size = Math.max(right - left, top - bottom);
    return [{ text: `${heightText(tall[index], unit)} high`, x: (left + right) / 2, y: (bottom + top) / 2, size }];
  });
}

const least = (numbers) => numbers.reduce((one, other) => Math.min(one, other));
const most = (numbers) => numbers.reduce((one, other) => Math.max(one, other));

function hits(boxes, left, top, right, bottom) {
  for (let at = 0; at < boxes.length; at += 4) {
    if (left < boxes[at + 2] && right > boxes[at] && top < boxes[at + 3] && bottom > boxes[at + 1]) return true;
  }
  return false;
}

// The robots on the screen, by their numbers; null if there are more than `most`.
function inSight(view, { poses, count }, most) {
  const [left, top] = view.toWorld(0, 0);
  const [right, bottom] = view.toWorld(view.width, view.height);
  const seen = [];
  for (let i = 0; i < count; i += 1) {
    const [x, y] = [poses[3 * i], poses[3 * i + 1]];
    if (!(x >= left && x <= right && y >= bottom && y <= top)) continue; // NaN in a row without a robot
    if (seen.length === most) return null;
    seen.push(i);
  }
  return seen;
}

// The middle of each group that keeps together on this screen, in pixels. A robot counts for its newest group.
function middles(view, { poses, groups, count }) {
  const sums = new Float64Array(4 * CODES); // of each group: robots, x, y, and the squares of both
  for (let i = 0; i < count; i += 1) {
    const at = 4 * groups[i];
    const [x, y] = [poses[3 * i], poses[3 * i + 1]];
    sums[at] += 1;
    sums[at + 1] += x;
    sums[at + 2] += y;
    sums[at + 3] += x * x + y * y;
  }
  const labels = [];
  for (let code = 1; code < CODES; code += 1) {
    const [number, across, up, square] = sums.subarray(4 * code, 4 * code + 4);
    if (number < 2) continue;
    const [x, y] = [across / number, up / number];
    const spread = Math.sqrt(Math.max(0, square / number - x * x - y * y)) * view.scale;
    if (spread < TOGETHER) labels.push({ code, x: view.toScreenX(x), y: view.toScreenY(y) - spread - 16 });
  }
  return labels;
}

// Inside the upper left corner of an area.
function cornerOf(view, { corners }) {
  const ys = corners.map(([, y]) => view.toScreenY(y));
  const top = Math.min(...ys);
  const left = Math.min(...corners.filter((_, corner) => ys[corner] - top < 1).map(([x]) => view.toScreenX(x)));
  return [left + 6, top + 12];
}

// ---- texts as pictures: a text with its edge takes long to draw, a picture of it does not

const SIDE = 1024; // pixels of the sheet that holds them
const EDGE = 4; // pixels around a text, for its edge
const HIGH = 28;

class Sprites {
  constructor() {
    this.widths = new Map();
    this.sheet = document.createElement("canvas");
    this.pen = this.sheet.getContext("2d");
    this.full = false; // whether it was just now
    this.clear(null, 1);
  }

  width(text, font) {
    const key = `${font} ${text}`;
    let width = this.widths.get(key);
    if (width === undefined) {
      this.pen.font = font;
      this.widths.set(key, (width = this.pen.measureText(text).width));
    }
    return width;
  }

  // Nothing is on the sheet: it is full, or colours or the screen are others.
  clear(colours, ratio) {
    this.colours = colours;
    this.ratio = ratio;
    this.sheet.width = this.sheet.height = SIDE * ratio;
    this.pen.scale(ratio, ratio);
    this.places = new Map(); // of each text, [x, y, width]
    this.widths.clear();
    this.x = this.y = 0;
  }

  draw(pen, labels, colours, ratio) {
    if (colours !== this.colours || ratio !== this.ratio) this.clear(colours, ratio);
    this.full = false;
    let places = labels.map((label) => this.place(label)); // all before any is used: what changes a sheet has it copied
    if (this.full) places = labels.map((label) => this.place(label));
    labels.forEach((label, number) => {
      if (!places[number]) return;
      const [x, y, width] = places[number];
      const [left, top] = [label.x - EDGE, label.y - HIGH / 2].map((at) => Math.round(at * ratio) / ratio);
      pen.drawImage(this.sheet, x * ratio, y * ratio, width * ratio, HIGH * ratio, left, top, width, HIGH);
    });
  }

  // Where on the sheet a text is, which may have been drawn just now.
  place({ text, font, colour }) {
    const key = `${font} ${colour} ${text}`;
    const known = this.places.get(key);
    if (known) return known;
    const width = Math.ceil(this.width(text, font)) + 2 * EDGE;
    if (width > SIDE) return null;
    if (this.x + width > SIDE) [this.x, this.y] = [0, this.y + HIGH];
    if (this.y + HIGH > SIDE) {
      this.clear(this.colours, this.ratio);
      this.full = true;
    }
    const { pen, x, y } = this;
    pen.font = font;
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    pen.lineWidth = 4;
    pen.strokeStyle = this.colours.ground;
    pen.strokeText(text, x + EDGE, y + HIGH / 2);
    pen.fillStyle = colour;
    pen.fillText(text, x + EDGE, y + HIGH / 2);
    const place = [x, y, width];
    this.places.set(key, place);
    this.x += width;
    return place;
  }
}
