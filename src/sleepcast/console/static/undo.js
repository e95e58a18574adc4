// What is done by hand on the page can be undone and done again: obstacles, the selection, layers. Each action has a name.
// What robots were told cannot be taken back, and nothing here tries to.

import { write } from "./elements.js";
import { Refusal } from "./wire.js";

const MAX = 100; // actions kept
const SHOWN = 6000; // ms for which the page tells what was undone
const NOTHING = "Commands to robots are never undone: send another one.";

export class Undo extends EventTarget {
  // bar: tells what was undone, and has a button for the way back.
  constructor(bar) {
    super();
    this.bar = bar;
    this.done = []; // {name, undo, redo}: functions that may ask the station, the latest action last
    this.undone = []; // the same of what was undone, the latest last
    this.stuck = null; // what was refused a moment ago
    this.coming = null;
    this.busy = false;
    this.timer = 0;
    this.button = bar.querySelector("button");
    this.button.addEventListener("click", () => (this.button.value === "redo" ? this.redo() : this.undo()));
    window.addEventListener("keydown", (event) => this.key(event));
  }

  // Something is being done by hand that will be known as a action when this promise has been kept or broken.
  wait(promise) {
    this.coming = promise;
  }

  // Something was done by hand.
  did(name, undo, redo) {
    this.done.push({ name, undo, redo });
    this.done.splice(0, this.done.length - MAX);
    this.undone = [];
    this.hide();
    this.changed();
  }

  undo() {
    return this.turn(this.done, this.undone, "undo");
  }

  redo() {
    return this.turn(this.undone, this.done, "redo");
  }

  // What Ctrl+Z and Ctrl+Shift+Z would do, in words.
  get choices() {
    const [last, next] = [this.done.at(-1), this.undone.at(-1)];
    return [
      [last ? `Undo: ${last.name}` : "Undo: nothing to undo", "Ctrl+Z", () => this.undo()],
      ...(next ? [[`Redo: ${next.name}`, "Ctrl+Shift+Z", () => this.redo()]] : []),
    ];
  }

  // Take the last of one list back, and put it into the other. What is refused stays, and the next time it is left out.
  async turn(from, to, way) {
    if (this.busy) return;
    this.busy = true;
    try {
      await this.coming;
      await this.turnLast(from, to, way);
    } finally {
      this.busy = false;
      this.changed();
    }
  }

  async turnLast(from, to, way) {
    if (this.stuck && from.at(-1) === this.stuck) from.pop();
    const action = from.at(-1);
    if (!action) {
      this.say(`Nothing to ${way}. ${NOTHING}`);
      return;
    }
    try {
      await action[way]();
      const index = from.lastIndexOf(action); // other actions may have come meanwhile
      if (index >= 0) from.splice(index, 1);
      to.push(action);
      this.stuck = null;
      this.say(`${way === "undo" ? "Undone" : "Done again"}: ${action.name}`, way === "undo" ? "redo" : "undo");
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.stuck = action;
      this.say(`Not ${way === "undo" ? "undone" : "done again"}: ${action.name}. ${refusal.message} The next ${way} leaves it out.`);
    }
  }

  key(event) {
    const name = event.key.toLowerCase();
    const typing = event.target.closest?.("textarea, select, dialog, [contenteditable], input:not([type=checkbox], [type=range])");
    if (typing || !(event.ctrlKey || event.metaKey) || event.altKey || (name !== "z" && name !== "y")) return;
    event.preventDefault();
    if (name === "y" || event.shiftKey) this.redo();
    else this.undo();
  }

  // ---- what the page tells

  say(text, back = "") {
    this.bar.hidden = false;
    write(this.bar.querySelector("span"), text);
    this.button.hidden = !back;
    this.button.value = back;
    this.button.textContent = back === "redo" ? "Redo" : "Undo";
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.hide(), SHOWN);
  }

  hide() {
    clearTimeout(this.timer);
    this.bar.hidden = true;
  }

  changed() {
    this.dispatchEvent(new Event("change"));
  }
}
