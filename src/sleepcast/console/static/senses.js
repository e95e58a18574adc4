// What the chosen robot senses, asked of the desk a few times a second while anybody shows it.

import { Refusal } from "./wire.js";

const AGAIN = 150; // ms between an answer and the next question

// "sensed" is dispatched after each answer.
export class Senses extends EventTarget {
  constructor(world, wire) {
    super();
    this.world = world;
    this.wire = wire;
    this.shown = []; // functions that say whether somebody shows it now
    this.known = null; // {robot, body} as the desk told it last; null while nobody knows
    this.refusal = ""; // why nobody knows
    this.waiting = false; // for an answer
    this.asked = null; // robot and tick of the last question
    this.next = 0;
    world.addEventListener("choose", () => this.renew());
  }

  // Somebody begins to show it, or it is another robot: ask at once.
  renew() {
    this.asked = null;
    this.ask();
  }

  // Ask again if anything may have changed since the last answer; called with every picture.
  async ask() {
    const { frame, marks } = this.world;
    if (this.waiting || marks.chosen < 0 || !frame || !this.shown.some((shown) => shown())) return;
    const same = this.asked?.robot === marks.chosen;
    if (same && (this.asked.tick === frame.tick || performance.now() < this.next)) return;
    this.asked = { robot: marks.chosen, tick: frame.tick };
    this.waiting = true;
    try {
      this.known = await this.wire.ask("sense", { robot: marks.chosen });
      this.refusal = "";
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

  // What is known of the chosen robot, or null.
  get body() {
    return this.known?.robot === this.world.marks.chosen ? this.known.body : null;
  }
}
