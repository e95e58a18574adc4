// Forms of solid things as triangles: bodies of robots, one metre from the middle to the side, which look along x, and what
// stands on the ground. Light comes from above and does not move, so each triangle has its shade from the start.
//
// A form is {corners: x, y and z of each corner in turn; shades: of each corner, of 1; triangles: the places of their corners,
// three to each}.

import { encloses } from "./polygon.js";

const LIGHT = [0.28, -0.42, 0.86]; // towards it
const DARKEST = 0.55;
const HEXAGON = Array.from({ length: 6 }, (_, corner) => [Math.cos((corner * Math.PI) / 3), Math.sin((corner * Math.PI) / 3)]);

// A form of which each triangle has its own shade.
function faceted(triangles) {
  const shades = triangles.flatMap((triangle) => Array(3).fill(shadeOf(normalOf(triangle))));
  return { corners: Float32Array.from(triangles.flat(2)), shades: Float32Array.from(shades), triangles: shades.map((_, at) => at) };
}

// One whose triangles have their corners in common, with the mean of their shades: a third as much to draw. It turns about z
// as a whole, so only how much a side looks up counts.
function smooth(triangles) {
  const places = new Map(); // by the words of a corner
  const [corners, sums, counts] = [[], [], []];
  const indices = triangles.flatMap((triangle) => {
    const shade = shadeOf([0, 0, normalOf(triangle)[2]], [0, 0, 1]);
    return triangle.map((corner) => {
      const words = corner.join();
      if (!places.has(words)) {
        places.set(words, places.size);
        corners.push(...corner);
        sums.push(0);
        counts.push(0);
      }
      const place = places.get(words);
      sums[place] += shade;
      counts[place] += 1;
      return place;
    });
  });
  return { corners: Float32Array.from(corners), shades: Float32Array.from(sums, (sum, at) => sum / counts[at]), triangles: indices };
}

function normalOf([from, a, b]) {
  const [u, v] = [a, b].map((to) => to.map((value, axis) => value - from[axis]));
  const normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
  const length = Math.hypot(...normal) || 1;
  return normal.map((value) => value / length);
}

function shadeOf(normal, light = LIGHT) {
  const towards = normal.reduce((sum, value, axis) => sum + value * light[axis], 0);
  return DARKEST + (1 - DARKEST) * (0.5 + 0.5 * towards);
}

// A polygon, counter-clockwise seen from above, in which all corners see the first one.
const fan = (corners) => corners.slice(2).map((corner, at) => [corners[0], corners[at + 1], corner]);

// A copter with four rotors: 29 triangles.
export function copter() {
  const [front, back, left, right, top, below] = [[0.5, 0, 0], [-0.5, 0, 0], [0, 0.3, 0], [0, -0.3, 0], [0, 0, 0.25], [0, 0, -0.2]];
  const triangles = [[[1, 0, 0.05], [0.4, 0.2, 0.05], [0.4, -0.2, 0.05]]];
  for (const [a, b] of [[front, left], [left, back], [back, right], [right, front]]) triangles.push([a, b, top], [b, a, below]);
  for (const [x, y] of [[1, 1], [1, -1], [-1, 1], [-1, -1]]) triangles.push(...fan(HEXAGON.map(([dx, dy]) => [0.62 * x + 0.38 * dx, 0.62 * y + 0.38 * dy, 0.12])));
  for (const y of [1, -1]) {
    const ends = [[-0.62, -0.62 * y], [0.62, 0.62 * y]];
    triangles.push(...fan([...ends.map(([dx, dy]) => [dx + 0.05 * y, dy - 0.05, 0.08]), ...ends.reverse().map(([dx, dy]) => [dx - 0.05 * y, dy + 0.05, 0.08])]));
  }
  return smooth(triangles);
}

// What is left of it from far away: 4 triangles.
export function farCopter() {
  const [nose, left, right] = [[1.1, 0, -0.1], [-0.8, 0.8, -0.1], [-0.8, -0.8, -0.1]];
  const sides = [[nose, left], [left, right], [right, nose]];
  return smooth([...sides.map(([a, b]) => [a, b, [-0.2, 0, 0.5]]), [nose, right, left]]);
}

// A plane: 16 triangles.
export function plane() {
  const [nose, tail, left, right, top, below] = [[0.9, 0, 0], [-0.95, 0, 0.05], [0, 0.1, 0], [0, -0.1, 0], [0, 0, 0.15], [0, 0, -0.1]];
  const triangles = [[[-0.65, 0, 0.05], [-0.95, 0, 0.4], [-0.95, 0, 0.05]]];
  for (const [a, b] of [[nose, left], [left, tail], [tail, right], [right, nose]]) triangles.push([a, b, top], [b, a, below]);
  const wing = [[0.3, 0, 0.05], [0, 1, 0.12], [-0.2, 1, 0.12], [-0.25, 0, 0.05]];
  triangles.push(...fan(wing), ...fan(wing.map(([x, y, z]) => [x, -y, z]).reverse()));
  triangles.push(...fan([[-0.6, 0, 0.08], [-0.85, 0.35, 0.08], [-0.95, 0.35, 0.08], [-0.95, -0.35, 0.08], [-0.85, -0.35, 0.08]]));
  return smooth(triangles);
}

export function farPlane() {
  const [nose, left, right] = [[0.9, 0, 0], [-0.4, 1, 0], [-0.4, -1, 0]];
  const sides = [[nose, left], [left, right], [right, nose]];
  return smooth(sides.flatMap(([a, b]) => [[a, b, [-0.2, 0, 0.3]], [b, a, [-0.2, 0, -0.15]]]));
}

// A cross over who has crashed, of two bars that are seen from all sides: 8 triangles of one shade.
export function cross() {
  const [long, wide, above] = [1.1, 0.14, 0.45];
  const bars = [[1, 1], [1, -1]].flatMap(([x, y]) => {
    const ends = [[-long * x, -long * y], [long * x, long * y]];
    const level = [...ends.map(([a, b]) => [a - wide * y, b + wide * x, above]), ...[...ends].reverse().map(([a, b]) => [a + wide * y, b - wide * x, above])];
    const upright = [...ends.map((end) => [...end, above - wide]), ...[...ends].reverse().map((end) => [...end, above + wide])];
    return [...fan(level), ...fan(upright)];
  });
  const form = faceted(bars);
  return { ...form, shades: form.shades.fill(1) };
}

// What drives: the arrow of the map, as high as wide.
export function rover() {
  const arrow = [[1.35, 0], [-0.9, 0.8], [-0.45, 0], [-0.9, -0.8]];
  return smooth([...fan([2, 3, 0, 1].map((at) => [...arrow[at], 0.7])), ...sidesOf(arrow, 0.7)]);
}

export function farRover() {
  const corners = [[1.35, 0, 0], [-0.9, 0.8, 0], [-0.9, -0.8, 0]];
  return smooth(corners.map((corner, at) => [corner, corners[(at + 1) % 3], [-0.4, 0, 0.8]]));
}

// A disc that lies on the ground.
export function disc() {
  return smooth(fan(HEXAGON.map(([x, y]) => [x, y, 0])));
}

// What is left of it from far away: 2 triangles.
export function farDisc() {
  return smooth(fan([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]]));
}

// What is solid, as prisms. obstacles: as in a scene. high: gives how high each is, m, by its index. triangulate(contour,
// holes): gives triangles by the indices of their corners, those of the contour first.
export function prisms(obstacles, high, triangulate) {
  const triangles = [];
  for (const [index, outlines] of obstacles.entries()) {
    const top = high(index);
    for (const outline of outlines) triangles.push(...sidesOf(outline, top));
    for (const [contour, ...holes] of contours(outlines)) {
      const corners = [contour, ...holes].flat();
      for (const corner of triangulate(contour, holes)) triangles.push(upwards(corner.map((at) => [...corners[at], top])));
    }
  }
  return faceted(triangles);
}

const sidesOf = (outline, high) =>
  outline.flatMap(([x, y], at) => {
    const [toX, toY] = outline[(at + 1) % outline.length];
    return [[[x, y, 0], [toX, toY, 0], [toX, toY, high]], [[x, y, 0], [toX, toY, high], [x, y, high]]];
  });

const upwards = ([a, b, c]) => (normalOf([a, b, c])[2] < 0 ? [a, c, b] : [a, b, c]);

// Outlines as what they bound: each lists an outer one and the holes in it. Inside is what an odd number of them encloses.
function contours(outlines) {
  const around = outlines.map((outline) => outlines.filter((other) => other !== outline && encloses(other.flat(), ...outline[0])));
  const outer = outlines.filter((_, at) => around[at].length % 2 === 0);
  return outer.map((contour) => [
    contour,
    ...outlines.filter((_, at) => around[at].length === around[outlines.indexOf(contour)].length + 1 && around[at].includes(contour)),
  ]);
}
