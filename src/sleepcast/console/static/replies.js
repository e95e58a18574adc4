// What each robot answered to a question, beside it on the map: asked of the desk for robots whose names are shown.

import { Refusal } from "./wire.js";

const AGAIN = 100; // ms between an answer and the next question
const MAX = 64; // robots in one question (console/incoming.py)

export class Replies {
  constructor(world, wire) {
    this.world = world;
    this.wire = wire;
    this.command = ""; // the question
    this.texts = new Map(); // what a robot answered, by its index; "" for nothing yet
    this.wanted = new Set(); // robots of which that is to be asked
    this.waiting = false;
    this.answered = 0;
  }

  // row: of the question whose answers are to be shown, null for none.
  about(row) {
    this.command = row?.id ?? "";
    this.texts.clear();
    this.wanted.clear();
    this.answered = 0;
    this.world.replies = row ? this : null;
    this.world.repaint("robots");
    if (row) this.count(row);
  }

  // The account of the question says something new; undefined: there is no such question at the time that the page shows.
  count(row) {
    const answered = row ? row.matched + row.not_matched + row.unknown + row.fault : 0;
    if (answered === this.answered) return;
    if (answered < this.answered) this.texts.clear(); // the page shows another time
    for (const [robot, text] of this.texts) if (!text) this.texts.delete(robot);
    this.answered = answered;
    this.world.repaint("robots");
  }

  // What a robot answered, "" for nothing or nothing known yet.
  of(robot) {
    const known = this.texts.get(robot);
    if (known === undefined && this.answered) {
      this.wanted.add(robot);
      this.ask();
    }
    return known ?? "";
  }

  async ask() {
    if (this.waiting || !this.wanted.size) return;
    this.waiting = true;
    const { command } = this;
    const robots = [...this.wanted].slice(0, MAX);
    for (const robot of robots) this.wanted.delete(robot);
    try {
      const { texts } = await this.wire.ask("replies", { command, robots });
      if (command === this.command) robots.forEach((robot, place) => this.texts.set(robot, texts[place]));
      this.world.repaint("robots");
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      if (command === this.command) for (const robot of robots) this.texts.set(robot, ""); // nobody knows them
    } finally {
      setTimeout(() => {
        this.waiting = false;
        this.ask();
      }, AGAIN);
    }
  }
}
