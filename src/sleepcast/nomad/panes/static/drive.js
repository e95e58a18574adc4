// Driving by hand: arrow keys, or the buttons of the pad, for as long as they are held. It stands for a joystick.
//
// While something is held the speeds are said again and again; the server lets the robot rest as soon as that ends.
// So a page that hangs, is closed or loses its connection leaves nothing driving.

const AGAIN = 200; // ms; the server waits for three times as long
const KEYS = { ArrowUp: "forward", ArrowDown: "back", ArrowLeft: "left", ArrowRight: "right" };
const TURNING = 0.5; // of the wanted speed that each wheel gets for turning
const STEERING = 300; // 1/10 degree a second, for a body that steers its wheels together

export class Driving {
  // places: elements on which the arrow keys drive.
  constructor(root, wire, windows, places) {
    this.wire = wire;
    this.windows = windows;
    this.pad = root.querySelector("#pad");
    this.pace = root.querySelector("#pace");
    this.held = new Map(); // ways (forward, back, left, right) to what holds them: "key" or "hand"
    this.robot = null; // the one that is driven
    this.timer = null;
    this.paced = () => {
      root.querySelector("#pace-text").textContent = `${this.pace.value} (1/10 in/s)`;
      if (this.held.size) this.drive();
    };
    this.pace.addEventListener("input", this.paced);
    this.paced();
    this.listen([this.pad, ...places]);
  }

  listen(places) {
    for (const place of places) {
      place.addEventListener("keydown", (event) => {
        const way = KEYS[event.key];
        if (!way || event.target === this.pace) return;
        if (event.shiftKey || event.ctrlKey || event.altKey || event.metaKey) return;
        event.preventDefault();
        event.stopImmediatePropagation(); // on the map of other robots, these keys choose one
        this.hold(way, "key");
      }, true);
      place.addEventListener("blur", () => this.leave());
    }
    window.addEventListener("keyup", (event) => this.letGo(KEYS[event.key]));
    window.addEventListener("blur", () => this.release());
    document.addEventListener("visibilitychange", () => this.release());
    for (const button of this.pad.querySelectorAll("button")) {
      button.addEventListener("pointerdown", (event) => {
        button.setPointerCapture(event.pointerId);
        this.hold(button.dataset.way, "hand");
      });
      for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
        button.addEventListener(end, () => this.letGo(button.dataset.way));
      }
      button.addEventListener("contextmenu", (event) => event.preventDefault());
    }
  }

  hold(way, by) {
    if (this.held.has(way)) return;
    this.held.set(way, by);
    this.robot ??= this.windows.chosen;
    this.timer ??= setInterval(() => this.drive(), AGAIN);
    this.drive();
  }

  letGo(way) {
    if (!this.held.delete(way)) return;
    if (this.held.size) this.drive();
    else this.release();
  }

  // The keys go elsewhere from now on, which is nothing to a button that is pressed.
  leave() {
    for (const [way, by] of [...this.held]) if (by === "key") this.letGo(way);
  }

  // All hands off.
  release() {
    this.held.clear();
    clearInterval(this.timer);
    this.timer = null;
    this.show();
    if (this.robot === null) return;
    this.wire.tell("drive", { robot: this.robot, numbers: [0, 0, 0] });
    this.robot = null;
  }

  drive() {
    this.show();
    const sum = (one, other) => Number(this.held.has(one)) - Number(this.held.has(other));
    const ahead = sum("forward", "back") * Number(this.pace.value);
    const turn = sum("left", "right");
    const steers = this.windows.steers[this.robot];
    const aside = Math.round(turn * TURNING * Number(this.pace.value));
    const numbers = steers ? [ahead, turn * STEERING, turn * STEERING] : [ahead + aside, ahead - aside, 0];
    this.wire.tell("drive", { robot: this.robot, numbers });
  }

  show() {
    for (const button of this.pad.querySelectorAll("button")) {
      button.classList.toggle("held", this.held.has(button.dataset.way));
    }
  }
}
