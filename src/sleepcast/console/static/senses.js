// What the chosen robot senses, asked of the desk a few times a second while anybody shows it.

import { Refusal } from "./wire.js";

const AGAIN = 150; // ms between an answer and the next question
const KEPT = 60; // simulated seconds
const MAX = 600; // looks kept

// Asks a question about the chosen robot again and again. "sensed" is dispatched after each answer.
export class Asking extends EventTarget {
  // kind: of the question, which names nothing but the robot.
  constructor(world, wire, kind) {
    super();
    this.world = world;
    this.wire = wire;
    this.kind = kind;
    this.shown = []; // functions that say whether somebody shows it now
    this.known = null; // the latest answer, which names its robot; null while nobody knows
    this.refusal = ""; // why nobody knows
    this.waiting = false; // for an answer
    this.asked = null; // robot and tick of the last question
    this.next = 0;
    this.forget();
    world.addEventListener("choose", () => {
      this.forget();
      this.renew();
    });
  }

  // What was seen before is not what is seen now.
  forget() {}

  // There is a new answer.
  keep() {}

  // Somebody begins to show it, or it is another robot: ask at once.
  renew() {
    this.asked = null;
    this.ask();
  }

  // The page looks at another time from now on: what was answered until now may be of any.
  jump() {
    this.asked = null;
  }

  // Ask again if anything may have changed since the last answer; called with every picture.
  async ask() {
    const { frame, marks } = this.world;
    if (!this.shown.some((shown) => shown())) {
      this.forget(); // there would be a gap
      return;
    }
    if (this.waiting || marks.chosen < 0 || !frame) return;
    const same = this.asked?.robot === marks.chosen;
    if (same && (this.asked.tick === frame.tick || performance.now() < this.next)) return;
    this.asked = { robot: marks.chosen, tick: frame.tick };
    this.waiting = true;
    try {
      this.known = await this.wire.ask(this.kind, { robot: marks.chosen });
      this.refusal = "";
      this.keep();
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.known = null;
      this.refusal = refusal.message;
    } finally {
      this.waiting = false;
      this.next = performance.now() + AGAIN;
      setTimeout(() => this.ask(), AGAIN); // the last picture before time stands still counts, too
    }
    this.dispatchEvent(new Event("sensed"));
    if (this.world.marks.chosen !== this.asked?.robot) this.ask(); // somebody chose another one meanwhile
  }

  // The latest answer if it is about the chosen robot, or null.
  get told() {
    return this.known?.robot === this.world.marks.chosen ? this.known : null;
  }
}

// What its body senses.
export class Senses extends Asking {
  constructor(world, wire) {
    super(world, wire, "sense");
  }

  forget() {
    this.far = []; // what its sonars measured: [time, ranges]
    this.near = []; // its infrared sensors and its bumper: [time, ranges, angles touched]
  }

  keep() {
    const { body, world, far, near } = this;
    const { time } = world.frame;
    if (!body || far.at(-1)?.[0] === time) return;
    if (far.length && time < far.at(-1)[0]) this.forget(); // time has gone back
    this.far.push([time, body.sonars]);
    this.near.push([time, body.infrared, body.touched]);
    for (const row of [this.far, this.near]) while (row.length > MAX || row[0][0] < time - KEPT) row.shift();
  }

  // What is known of the chosen robot, or null.
  get body() {
    return this.told?.body ?? null;
  }
}
