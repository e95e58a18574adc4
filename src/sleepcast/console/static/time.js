// Time: run, pause, one tick; how fast it is wanted to run and how fast it does.

import { clock } from "./accounting.js";
import { hide, write } from "./elements.js";

const FASTEST = 10000; // as fast as possible
const SPEEDS = [0.5, 1, 2, 5, 10, 30, 60, 100, 300, FASTEST];
const NEAR = 0.05; // of the wanted speed: what differs by less is the measuring
const BEHIND = 0.93; // below, the page says that the wanted speed is not reached
const READABLE = 500; // ms that a speed is told at least

export class Time {
  constructor(root, wire) {
    this.wire = wire;
    this.find = (id) => root.querySelector(`#${id}`);
    this.running = true;
    this.wanted = 0;
    this.toldAt = -Infinity; // when the page told another speed
    this.find("run").addEventListener("click", () => this.toggle());
    this.find("step").addEventListener("click", () => this.step());
    this.find("speed").addEventListener("change", (event) => wire.tell("pace", { factor: Number(event.target.value) }));
    wire.addEventListener("compiling", ({ detail: { done, most } }) => {
      this.find("compiled").textContent = `: kernel ${done} of at most ${most}`;
    });
    window.addEventListener("keydown", (event) => {
      if (!event.ctrlKey || event.altKey || event.metaKey) return;
      if (event.code === "Space") this.toggle();
      else if (event.key === ".") this.step();
      else return;
      event.preventDefault();
    });
  }

  toggle() {
    this.wire.tell("pace", { running: !this.running });
  }

  step() {
    this.wire.tell("step");
  }

  show(frame) {
    if (frame.wanted !== this.wanted) this.offer(frame.wanted);
    this.wanted = frame.wanted;
    this.running = frame.running;
    this.find("run").dataset.running = frame.running;
    this.find("run").dataset.waiting = frame.waiting;
    this.find("run").setAttribute("aria-label", frame.running ? "Pause" : frame.waiting ? "Start" : "Run");
    write(this.find("clock"), clock(frame.time));
    hide(this.find("preparing"), !frame.preparing);
    this.tellSpeed(frame);
  }

  // How fast time runs, or that it does not. A busy computer runs a bit faster or slower at each frame, which nobody could
  // read: while time runs on, there is another speed no more often than twice a second.
  tellSpeed({ running, preparing, waiting, wanted, achieved }) {
    const runs = running && !preparing;
    const now = performance.now();
    if (runs && now - this.toldAt < READABLE) return;
    this.toldAt = runs ? now : -Infinity;
    const behind = runs && wanted < FASTEST && achieved < BEHIND * wanted;
    const near = Math.abs(achieved - wanted) < NEAR * wanted;
    const speed = `running at ${factor(near ? wanted : achieved)}`;
    write(this.find("achieved"), preparing ? "compiling" : running ? speed : waiting ? "not started" : "paused");
    this.find("achieved").classList.toggle("behind", behind);
  }

  offer(wanted) {
    const speeds = [...new Set([...SPEEDS, wanted])].sort((a, b) => a - b);
    this.find("speed").replaceChildren(
      ...speeds.map((speed) => new Option(factor(speed), String(speed), false, speed === wanted)),
    );
  }
}

// A factor with two or three digits: 0.5×, 9.8×, 30×.
function factor(value) {
  if (value >= FASTEST) return "max";
  return `${value >= 9.95 ? Math.round(value) : +value.toFixed(1)}×`;
}
