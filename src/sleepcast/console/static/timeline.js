// The timeline: a strip on which the whole run can be looked at while it goes on, or a recording; with marks of what
// happened. A page that looks at the past says so, and one key brings it back to now.

import { clock } from "./accounting.js";
import { hide, write } from "./elements.js";
import { Refusal } from "./wire.js";

export const LIVE_KEY = "F8";
const STEPS = 200; // from one end to the other, for the arrow keys
const BIG = 20; // of these steps for Page Up and Page Down
const SEEK_EVERY = 33; // ms between two seeks: the station has no more pictures, and reads no more messages
const HELD = 300; // ms after which a strip that was moved follows the pictures again, which come later than the hand
const LETTERS = { command: "", ask: "?", stop: "■", release: "▶", fault: "!", join: "+", birth: "*", death: "†", turnover: "±", alert: "▲" };

export class Timeline extends EventTarget {
  // on the page of a recording: seeks the recording; else looks at the past of a run, which is a matter of this page.
  constructor(root, wire) {
    super();
    this.root = root;
    this.wire = wire;
    this.find = (name) => root.querySelector(`.${name}`);
    this.strip = this.find("strip");
    this.began = 0;
    this.ended = 0;
    this.now = 0; // what is shown, s
    this.at = null; // what is looked at, s; null where it is now
    this.recorded = false;
    this.looks = 0; // how often this page has asked to look elsewhere
    this.sought = 0; // the timer after which a seek goes out, 0 if none waits
    this.moved = -HELD;
    this.seen = null; // the moment of which the station last said that all of it is there, null for now
    this.marks = [];
    this.placed = 0; // the seconds for which the marks are placed
    this.find("to-live").addEventListener("click", () => this.toLive());
    this.strip.addEventListener("keydown", (event) => this.key(event));
    this.strip.addEventListener("pointerdown", (event) => this.press(event));
    this.strip.addEventListener("pointermove", (event) => this.strip.hasPointerCapture(event.pointerId) && this.go(this.timeAt(event)));
    this.find("marks").addEventListener("click", (event) => this.choose(event));
    window.addEventListener("keydown", (event) => {
      if (event.key !== LIVE_KEY || event.repeat || this.recorded) return;
      event.preventDefault();
      this.toLive();
    });
    this.find("fork").addEventListener("click", () => this.fork());
    this.find("alternate").addEventListener("click", () => this.toggleAlternate());
    wire.addEventListener("span", ({ detail }) => this.setSpan(detail));
    wire.addEventListener("marked", ({ detail }) => this.setMarks(detail.marks));
    wire.addEventListener("hello", ({ detail }) => this.setRecorded(detail.began, detail.recorded));
  }

  // When the recording that is shown begins and ends, in seconds; it ends at 0 where the swarm lives.
  setRecorded(began, ended) {
    this.recorded = ended > 0;
    this.marks = [];
    this.looks = 0;
    this.seen = null;
    this.setAt(null);
    this.root.hidden = !this.recorded;
    this.root.classList.toggle("recorded", this.recorded);
    if (this.recorded) this.setEnds(began, ended);
  }

  // What the station keeps, and what this page looks at.
  setSpan(span) {
    this.root.hidden = false;
    this.strip.title = span.kept;
    if (!this.recorded) this.setEnds(span.began, span.ended);
    if (span.number >= this.looks && !this.sought) this.setAt(span.at); // else it was on its way when the page turned
    this.forked = span.forked;
    hide(this.find("forked"), this.forked === null);
    if (this.forked !== null) this.find("forked").style.left = `${(100 * (this.forked - this.began)) / Math.max(1e-9, this.ended - this.began)}%`;
    hide(this.find("alternate"), this.forked === null);
    hide(this.find("fork"), !span.may_fork || this.at === null);
    this.note(span);
    this.tellSeen(span);
  }

  // The station answers for another moment from now on, and all of it is there, or never will be.
  tellSeen({ number, at, exact, note }) {
    if (number < this.looks || this.sought || at === this.seen || (at !== null && !exact && !note)) return;
    this.seen = at;
    this.dispatchEvent(new CustomEvent("seen", { detail: at }));
  }

  setEnds(began, ended) {
    this.began = began;
    this.ended = Math.max(began, ended);
    this.strip.setAttribute("aria-valuemin", began.toFixed(2));
    this.strip.setAttribute("aria-valuemax", this.ended.toFixed(2));
    write(this.find("from"), clock(began));
    write(this.find("until"), clock(this.ended));
    this.draw();
  }

  // The time of the picture that is on the map.
  show(time) {
    if (this.recorded && (this.sought || performance.now() - this.moved <= HELD)) return;
    this.now = time;
    this.draw();
  }

  // What is looked at: a time, or null for now.
  setAt(time) {
    const before = this.at;
    this.at = time;
    document.body.classList.toggle("past", time !== null);
    this.root.classList.toggle("looking", time !== null);
    if ((before === null) !== (time === null)) this.dispatchEvent(new CustomEvent("turned", { detail: time }));
    this.draw();
  }

  note(span) {
    const said = this.find("moment");
    const ago = Math.max(0, span.ended - (span.at ?? span.ended));
    let text = "";
    if (span.at !== null) text = `${clock(span.at)}, ${ago < 60 ? `${Math.round(ago)} s` : clock(ago)} ago. Live goes on.`;
    if (span.at === null && span.forked !== null) text = `Went on from ${clock(span.forked)}. ${differenceOf(span)}`;
    if (span.note) text += ` ${span.note}`;
    else if (span.at !== null && !span.exact) text += " Running it again …";
    write(said, text);
    said.title = text;
  }

  // Whether what is shown is not what is now.
  get elsewhere() {
    return this.recorded || this.at !== null;
  }

  // The strip's time: what is looked at, else what is shown.
  get time() {
    return this.at ?? this.now;
  }

  draw() {
    const span = Math.max(1e-9, this.ended - this.began);
    const part = Math.min(1, Math.max(0, (this.time - this.began) / span));
    this.find("hand").style.left = `${100 * (this.at === null && !this.recorded ? 1 : part)}%`;
    const text = this.at === null && !this.recorded ? `${clock(this.ended)}, live` : clock(this.time);
    this.strip.setAttribute("aria-valuenow", Math.min(this.time, this.ended).toFixed(2));
    if (this.strip.getAttribute("aria-valuetext") !== text) this.strip.setAttribute("aria-valuetext", text);
    this.place(span);
  }

  setMarks(marks) {
    this.marks = marks;
    const line = this.find("marks");
    line.replaceChildren(
      ...marks.map((mark, index) => {
        const button = document.createElement("button");
        button.type = "button";
        button.tabIndex = -1; // the strip's own keys go from mark to mark
        button.className = `mark ${mark.kind}`;
        button.dataset.index = String(index);
        button.textContent = LETTERS[mark.kind] ?? "";
        button.title = `${clock(mark.at)} ${mark.text}`;
        button.setAttribute("aria-label", `${mark.kind} at ${clock(mark.at)}: ${mark.text}`);
        return button;
      }),
    );
    this.placed = 0;
    this.draw();
  }

  // Put the marks where they belong on a strip of so many seconds.
  place(span) {
    if (this.placed === span || !this.marks.length) return;
    this.placed = span;
    [...this.find("marks").children].forEach((button, index) => {
      button.style.left = `${(100 * Math.max(0, this.marks[index].at - this.began)) / span}%`;
    });
  }

  // ---- going there

  timeAt(event) {
    const box = this.strip.getBoundingClientRect();
    return this.began + (this.ended - this.began) * Math.min(1, Math.max(0, (event.clientX - box.left) / box.width));
  }

  press(event) {
    if (event.button !== 0 || event.target.closest(".mark")) return;
    this.strip.setPointerCapture(event.pointerId);
    this.strip.focus();
    event.preventDefault();
    this.go(this.timeAt(event));
  }

  choose(event) {
    const button = event.target.closest(".mark");
    if (!button) return;
    const mark = this.marks[Number(button.dataset.index)];
    this.strip.focus();
    this.go(mark.seen);
    this.dispatchEvent(new CustomEvent("mark", { detail: mark }));
  }

  // Look at a time, and where the strip stands then if it is being dragged.
  go(time) {
    const wanted = Math.min(this.ended, Math.max(this.began, time));
    this.moved = performance.now();
    if (this.recorded) this.now = wanted;
    else this.setAt(wanted);
    this.draw();
    this.dispatchEvent(new CustomEvent("jump", { detail: wanted }));
    this.sought ||= setTimeout(() => {
      this.sought = 0;
      if (this.recorded) this.wire.tell("seek", { time: this.now });
      else if (this.at !== null) this.look(this.at);
    }, SEEK_EVERY);
  }

  look(time) {
    this.looks += 1;
    this.wire.tell("look", { time, number: this.looks });
  }

  toLive() {
    if (this.recorded || this.at === null) return;
    clearTimeout(this.sought);
    this.sought = 0;
    this.setAt(null);
    this.find("moment").textContent = "";
    this.look(null);
    this.dispatchEvent(new CustomEvent("jump", { detail: null }));
  }

  // Let the run go on from what is looked at.
  async fork() {
    try {
      await this.wire.ask("fork", { time: this.at }, Infinity);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.wire.emit("refused", { reason: refusal.message });
    }
  }

  toggleAlternate() {
    const on = this.find("alternate").getAttribute("aria-pressed") !== "true";
    this.find("alternate").setAttribute("aria-pressed", String(on));
    this.wire.tell("ghosts", { on });
    this.dispatchEvent(new CustomEvent("alternate", { detail: on }));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = (this.ended - this.began) / STEPS;
    const steps = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageUp: BIG, PageDown: -BIG }[event.key];
    if (steps && event.shiftKey) this.toMark(Math.sign(steps));
    else if (steps) this.go(this.time + steps * step);
    else if (event.key === "Home") this.go(this.began);
    else if (event.key === "End" && this.recorded) this.go(this.ended);
    else if (event.key === "End" || event.key === "Escape") this.toLive();
    else return;
    event.preventDefault();
  }

  // The next mark in a direction.
  toMark(direction) {
    const times = this.marks.map((mark) => mark.seen).filter((seen) => (seen - this.time) * direction > 1e-6);
    if (!times.length) return;
    const next = direction > 0 ? Math.min(...times) : Math.max(...times);
    this.go(next);
    this.dispatchEvent(new CustomEvent("mark", { detail: this.marks.find((mark) => mark.seen === next) }));
  }
}

// How two futures differ, in a sentence; or why that is not known.
function differenceOf({ differs, difference }) {
  return differs === null ? difference || "No difference yet." : `First difference at ${difference}.`;
}
