// A link that opens the same view: which part of the world is seen, the chosen robot, and the open pane, in the part of
// the address after #. The address keeps up with what is seen, so it can be copied or kept as a bookmark.

const PAUSE = 400; // ms without a change before the address is written: browsers allow no more often

export class Link {
  constructor(world, drawer, choose) {
    this.parts = { world, drawer, choose };
    this.wanted = new URLSearchParams(window.location.hash.slice(1));
    this.timer = 0;
    world.addEventListener("moved", () => this.changed());
    world.addEventListener("choose", () => this.changed());
    drawer.addEventListener("change", () => this.changed());
  }

  // The scene is known, and the map stands at what it would show: go where the address says.
  follow() {
    const { world, drawer, choose } = this.parts;
    const { wanted } = this;
    this.wanted = null;
    if (!wanted) return;
    const robot = wanted.get("robot"); // a row without a robot has an empty name, which nobody means
    const index = robot ? world.scene.names.indexOf(robot) : -1;
    if (index >= 0) choose(index);
    if (wanted.has("pane")) drawer.open(wanted.get("pane"));
    const [x, y, across] = (wanted.get("view") ?? "").split(",").map(Number);
    if ([x, y, across].every(Number.isFinite) && across > 0) world.look(x, y, across);
  }

  changed() {
    if (this.wanted) return; // nothing was looked at yet
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.write(), PAUSE);
  }

  write() {
    const { world, drawer } = this.parts;
    const parts = new URLSearchParams();
    if (!world.fitted) {
      const { x, y, width, scale } = world.view;
      parts.set("view", [x, y, width / scale].map((number) => Number(number.toPrecision(6))).join());
    }
    const name = world.scene?.names[world.marks.chosen];
    if (name !== undefined) parts.set("robot", name);
    if (drawer.current) parts.set("pane", drawer.current);
    const hash = parts.size ? `#${parts}` : window.location.pathname + window.location.search; // a token only where nothing is kept
    window.history.replaceState(null, "", hash);
  }
}
