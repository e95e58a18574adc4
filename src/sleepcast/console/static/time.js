// Time: run, pause, one tick; how fast it is wanted to run and how fast it does.

import { clock } from "./accounting.js";

const FASTEST = 10000; // as fast as possible
const SPEEDS = [0.5, 1, 2, 5, 10, 30, 60, 100, 300, FASTEST];
const NEAR = 0.05; // of the wanted speed: what differs by less is the measuring
const SCRUB_STEPS = 200; // of the slider from one end to the other, for the arrow keys
const SEEK_EVERY = 33; // ms between two seeks: the film has no more pictures, and the station reads no more messages
const HELD = 300; // ms after which a slider that was moved follows the pictures again, which come later than the hand
const BEHIND = 0.93; // below, the page says that the wanted speed is not reached

export class Time {
  constructor(root, wire) {
    this.wire = wire;
    this.find = (id) => root.querySelector(`#${id}`);
    this.running = true;
    this.wanted = 0;
    this.find("run").addEventListener("click", () => this.toggle());
    this.find("step").addEventListener("click", () => this.step());
    this.find("speed").addEventListener("change", (event) => wire.tell("pace", { factor: Number(event.target.value) }));
    this.scrub = this.find("scrub"); // null on a page that shows no recordings
    this.scrub?.addEventListener("input", () => this.seek());
    this.preparing = this.find("preparing"); // null on the Nomads' page
    this.sought = 0; // the timer after which a seek goes out, 0 if none waits
    this.moved = -HELD; // when the slider was last moved by hand
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

  // When the recording that is shown begins and ends, in seconds; it ends at 0 where the swarm lives.
  setRecorded(began, ended) {
    const step = Math.ceil((1e6 * (ended - began)) / SCRUB_STEPS) / 1e6; // in whole us, so that so many reach the end
    this.scrub.hidden = ended === 0;
    this.scrub.min = String(began);
    this.scrub.max = String(ended + step / 2);
    this.scrub.step = String(step);
  }

  // Go where the slider stands, and where it stands then if it is being dragged.
  seek() {
    this.moved = performance.now();
    this.scrub.setAttribute("aria-valuetext", clock(Number(this.scrub.value)));
    this.sought ||= setTimeout(() => {
      this.sought = 0;
      this.wire.tell("seek", { time: Number(this.scrub.value) });
    }, SEEK_EVERY);
  }

  show(frame) {
    if (this.scrub && !this.scrub.hidden && !this.sought && performance.now() - this.moved > HELD) {
      this.scrub.value = String(frame.time);
      this.scrub.setAttribute("aria-valuetext", clock(frame.time));
    }
    if (frame.wanted !== this.wanted) this.offer(frame.wanted);
    this.wanted = frame.wanted;
    this.running = frame.running;
    this.find("run").dataset.running = frame.running;
    this.find("run").dataset.waiting = frame.waiting;
    this.find("run").setAttribute("aria-label", frame.running ? "Pause" : frame.waiting ? "Start" : "Run");
    this.find("clock").textContent = clock(frame.time);
    const behind = frame.running && !frame.preparing && frame.wanted < FASTEST && frame.achieved < BEHIND * frame.wanted;
    const near = Math.abs(frame.achieved - frame.wanted) < NEAR * frame.wanted;
    const running = `running at ${factor(near ? frame.wanted : frame.achieved)}`;
    if (this.preparing) this.preparing.hidden = !frame.preparing;
    this.find("achieved").textContent = frame.preparing ? "compiling" : frame.running ? running : frame.waiting ? "not started" : "paused";
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
