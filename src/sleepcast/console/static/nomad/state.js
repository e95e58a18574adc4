// What the server has told: the robots, their traces, what programs drew, and the robot that is looked at.

const MOST_POINTS = 4000; // of a trace that are kept here
const ROWS = { echoes: 1000, commands: 200, said: 200, far: 150, near: 150 }; // of the chosen robot
const MOST_CONTACTS = 200; // places where the bumper felt something
const APART = 0.05; // m between two of them
const MOST_SKETCHES = 5000;
const AROUND = 0.4; // m in sight around everything that there is
const LEAST = 2; // m in sight from the middle to each side at least

export const LAYERS = [
  { name: "actual", title: "actual trace", order: "refresh_actual_trace" },
  { name: "encoder", title: "encoder trace", order: "refresh_encoder_trace" },
  { name: "sonar", title: "sonar", order: "refresh_sonar_sensor" },
  { name: "infrared", title: "infrared", order: "refresh_infrared_sensor" },
  { name: "bumper", title: "bumper", order: "refresh_bumper_sensor" },
  { name: "graphics", title: "drawn by programs", order: "refresh_client_graphics" },
];

// A pose comes as [x, y, heading, turret] in m and rad.
export class State {
  constructor() {
    this.kinds = []; // {name, steers, radius}
    this.robots = []; // {real, believed, touched, waiting, client, rivals}
    this.traces = []; // of each robot: [actual, encoder], each x, y in turn, null for a gap
    this.sketches = []; // {kind, numbers, mode}
    this.solids = [];
    this.version = 0;
    this.time = 0;
    this.chosen = 0;
    this.shown = Object.fromEntries(LAYERS.map(({ name }) => [name, true]));
    this.forget();
  }

  greet(hello) {
    this.tenth = hello.tenth;
    this.degree = hello.degree;
    this.grid = hello.grid;
    this.area = hello.area;
    this.kinds = hello.robots;
    this.traces = this.kinds.map(() => [[], []]);
    this.sketches = [];
    this.robots = [];
    this.version = 0;
    if (this.chosen >= this.kinds.length) this.chosen = 0;
    this.forget();
  }

  // Nothing is known of the chosen robot but its place.
  forget() {
    this.own = null;
    this.echoes = [];
    this.commands = [];
    this.said = [];
    this.far = []; // what its sonars measured: [time, ranges in m, ..]
    this.near = []; // its infrared sensors and its bumper: [time, ranges, angles touched]
    this.contacts = []; // where the bumper was touched, x, y in turn, by belief
    this.erased = {};
  }

  choose(robot) {
    this.chosen = robot;
    this.forget();
  }

  get robot() {
    return this.robots[this.chosen];
  }

  get kind() {
    return this.kinds[this.chosen];
  }

  // Take a picture in; whether traces or drawings have changed.
  take(picture) {
    this.time = picture.time;
    const names = ["real", "believed", "touched", "waiting", "client", "rivals"];
    this.robots = picture.robots.map((robot) => Object.fromEntries(names.map((name, at) => [name, robot[at]])));
    for (const [robot, layer, anew, points] of picture.traces) {
      if (anew) this.traces[robot][layer] = [];
      grow(this.traces[robot][layer], points, 2 * MOST_POINTS);
    }
    const [anew, drawn] = picture.sketches;
    if (anew) this.sketches = [];
    grow(this.sketches, drawn.map(([kind, numbers, mode]) => ({ kind, numbers, mode })), MOST_SKETCHES);
    if (picture.chosen?.robot === this.chosen) this.look(picture.chosen);
    return picture.traces.length > 0 || anew || drawn.length > 0;
  }

  look(own) {
    this.own = own;
    for (const [name, most] of Object.entries(ROWS)) {
      const [anew, items] = own[name];
      if (anew) this[name] = [];
      grow(this[name], items, most);
    }
    if (own.erased.bumper !== this.erased.bumper) this.contacts = [];
    this.erased = own.erased;
    const [x, y, heading] = this.robot.believed;
    for (const angle of own.touched) {
      const at = [x + this.kind.radius * Math.cos(heading + angle), y + this.kind.radius * Math.sin(heading + angle)];
      const [lastX, lastY] = this.contacts.slice(-2);
      if (Math.hypot(at[0] - lastX, at[1] - lastY) < APART) continue;
      grow(this.contacts, at, 2 * MOST_CONTACTS);
    }
  }

  // Everything that there is, with some room around it: least x, least y, greatest x, greatest y.
  extent() {
    const points = [...this.solids.flat(), ...this.robots.map(({ real }) => real)];
    if (!points.length) return this.area;
    const [left, bottom, right, top] = this.area;
    const [x, across] = middleOf(points.map((at) => at[0]));
    const [y, up] = middleOf(points.map((at) => at[1]));
    return [Math.max(left, x - across), Math.max(bottom, y - up), Math.min(right, x + across), Math.min(top, y + up)];
  }

  // In the Nomad's own units.
  tenths(metres) {
    return Math.round(metres / this.tenth);
  }

  inches(metres) {
    return Math.round(metres / this.tenth / 10);
  }

  // A direction, 0 to 3599 tenths of degrees.
  direction(radians) {
    return ((Math.round(radians / this.degree) % 3600) + 3600) % 3600;
  }
}

// The middle of numbers, and how far to both sides to show them all.
function middleOf(numbers) {
  let [least, most] = [Infinity, -Infinity];
  for (const number of numbers) [least, most] = [Math.min(least, number), Math.max(most, number)];
  return [(least + most) / 2, Math.max(LEAST, (most - least) / 2) + AROUND];
}

function grow(row, items, most) {
  for (const item of items) row.push(item);
  if (row.length > most) row.splice(0, row.length - most);
}
