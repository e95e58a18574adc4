// What the desk tells of Nomads beside frames: what each robot is like, traces, what programs drew, and what the chosen robot
// senses. For the panes of sensors it stands for `Senses`: it is told, and needs not ask.

const MAX_POINTS = 4000; // of a trace that are kept here
const ROWS = { echoes: 1000, far: 150, near: 150 }; // of the chosen robot
const MAX_CONTACTS = 200; // places where the bumper felt something
const APART = 0.05; // m between two of them
const MAX_SKETCHES = 5000;

// A pose comes as [x, y, heading, turret] in m and rad. "sensed" is dispatched when something was told.
export class Windows extends EventTarget {
  constructor(world) {
    super();
    this.world = world;
    this.robots = []; // {turret, believed, touched, waiting, client, rivals}
    this.traces = []; // of each robot: [actual, encoder], each x, y in turn, null for a gap
    this.sketches = []; // {kind, numbers, mode}
    this.shown = []; // as of Senses
    this.refusal = "";
    this.forget();
    world.addEventListener("choose", () => this.forget());
  }

  greet({ tenth, degree, steers }) {
    Object.assign(this, { tenth, degree, steers });
    this.traces = steers.map(() => [[], []]);
    this.sketches = [];
    this.robots = [];
    this.forget();
  }

  // Nothing is known of the chosen robot but its place.
  forget() {
    this.body = null;
    this.echoes = [];
    this.far = []; // what its sonars measured: [time, ranges in m, ..]
    this.near = []; // its infrared sensors and its bumper: [time, ranges, angles touched]
    this.contacts = []; // where the bumper was touched, x, y in turn, by belief
    this.erased = {};
  }

  renew() {}

  get chosen() {
    return this.world.marks.chosen;
  }

  get robot() {
    return this.robots[this.chosen];
  }

  // Where a robot is on the map, with its turret.
  real(index) {
    const { poses } = this.world.frame;
    return [...poses.subarray(3 * index, 3 * index + 3), this.robots[index]?.turret ?? 0];
  }

  take(news) {
    const names = ["turret", "believed", "touched", "waiting", "client", "rivals"];
    this.robots = news.robots.map((robot) => Object.fromEntries(names.map((name, at) => [name, robot[at]])));
    for (const [robot, layer, anew, points] of news.traces) {
      if (anew) this.traces[robot][layer] = [];
      grow(this.traces[robot][layer], points, 2 * MAX_POINTS);
    }
    const [anew, drawn] = news.sketches;
    if (anew) this.sketches = [];
    grow(this.sketches, drawn.map(([kind, numbers, mode]) => ({ kind, numbers, mode })), MAX_SKETCHES);
    if (news.chosen?.robot === this.chosen) this.look(news.chosen);
    if (news.traces.length || anew || drawn.length) this.world.repaint("trails");
    this.dispatchEvent(new Event("sensed"));
  }

  look(own) {
    this.body = own.body;
    for (const [name, most] of Object.entries(ROWS)) {
      const [anew, items] = own[name];
      if (anew) this[name] = [];
      grow(this[name], items, most);
    }
    if (own.erased.bumper !== this.erased.bumper) this.contacts = [];
    this.erased = own.erased;
    const [x, y, heading] = own.body.believed;
    for (const angle of own.body.touched) {
      const at = [x + own.body.radius * Math.cos(heading + angle), y + own.body.radius * Math.sin(heading + angle)];
      const [lastX, lastY] = this.contacts.slice(-2);
      if (Math.hypot(at[0] - lastX, at[1] - lastY) < APART) continue;
      grow(this.contacts, at, 2 * MAX_CONTACTS);
    }
  }

  // In the Nomads' own units.
  tenths(metres) {
    return Math.round(metres / this.tenth);
  }

  // A direction, 0 to 3599 tenths of degrees.
  direction(radians) {
    return ((Math.round(radians / this.degree) % 3600) + 3600) % 3600;
  }
}

function grow(row, items, most) {
  for (const item of items) row.push(item);
  if (row.length > most) row.splice(0, row.length - most);
}
