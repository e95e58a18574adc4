// Numbers in the prompt as sliders: one is dragged to the left and right, or stepped with Alt and the arrow keys. The map
// and the counts follow, and below it stands how what it is compared with is spread over the robots.

import { drawSpread } from "./spread.js";
import { Refusal } from "./wire.js";

const START = 4; // pixels: what moves less is a click
const PIXELS = 3; // of a drag for one step
const STEPS = 100; // of about this many the range of the robots' values consists
const AGAIN = 1000; // ms after which the robots' values have changed enough to ask again
const LITERAL = /^([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(.*)$/i;

export class NumberDrag {
  // prompt: whose numbers are dragged. box: the element below the number.
  constructor(prompt, wire, box) {
    this.prompt = prompt;
    this.editor = prompt.editor;
    this.wire = wire;
    this.box = box;
    this.held = null; // the drag that goes on: {from, before, start, end, step, moved}
    this.at = -1; // where the number begins that the box is about, -1 for none
    this.spread = null;
    this.asking = false;
    const { area } = this.editor;
    area.addEventListener("pointermove", (event) => this.move(event));
    area.addEventListener("pointerdown", (event) => this.down(event));
    area.addEventListener("pointerup", (event) => this.up(event));
    area.addEventListener("pointercancel", (event) => this.up(event));
    area.addEventListener("mousedown", (event) => this.held && event.preventDefault()); // it selects no text
    area.addEventListener("keydown", (event) => this.key(event));
    area.addEventListener("blur", () => this.held || this.hide());
    this.editor.addEventListener("change", () => this.hide());
    document.addEventListener("selectionchange", () => this.left());
    setInterval(() => {
      if (!this.box.hidden && document.visibilityState === "visible") this.ask();
    }, AGAIN);
  }

  // ---- by the pointer

  // The number under the pointer, or null.
  under(event) {
    if (this.editor.area.readOnly) return null;
    const { clientX: x, clientY: y } = event;
    const here = ({ left, right, top, bottom }) => left - 1 <= x && x <= right + 1 && top <= y && y <= bottom;
    return this.editor.tokens.find((token) => token.kind === "number" && this.editor.boxes(token).some(here)) ?? null;
  }

  down(event) {
    if (event.button !== 0 || event.shiftKey) return;
    const token = this.under(event);
    if (!token) return;
    const [box] = this.editor.boxes(token);
    const into = Math.round(((event.clientX - box.left) / box.width) * token.text.length);
    this.editor.area.focus();
    this.editor.area.setSelectionRange(token.start + into, token.start + into);
    this.held = { from: event.clientX, before: this.editor.text, start: token.start, end: token.end, moved: false };
    this.editor.area.setPointerCapture(event.pointerId);
    this.touch(token.start);
  }

  move(event) {
    const { held } = this;
    if (!held) {
      this.editor.area.classList.toggle("on-number", this.under(event) !== null);
      return;
    }
    const far = event.clientX - held.from;
    if (!held.moved && Math.abs(far) < START) return;
    const [number, unit] = parsed(held.before.slice(held.start, held.end));
    if (!held.moved) held.step = stepOf(number, this.spread);
    held.moved = true;
    this.turn(held.start, stepped(number, Math.round(far / PIXELS), held.step, leastOf(number, this.spread)) + unit);
  }

  up() {
    const { held } = this;
    this.held = null;
    if (!held?.moved) return;
    // As one change that the browser's own undo knows of.
    const { text } = this.editor;
    const number = text.slice(held.start, text.length - (held.before.length - held.end));
    this.editor.turn(held.before, held.end);
    this.settle(held.start, held.end, ...parsed(number));
  }

  // ---- by the keyboard

  key(event) {
    const step = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (event.key === "Escape" && !this.box.hidden) this.hide();
    if (!step || !event.altKey || event.ctrlKey || event.metaKey || this.editor.area.readOnly) return;
    const token = this.atCaret();
    if (!token) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.step(token, event.shiftKey ? 10 * step : step);
  }

  // Step a number, by steps that fit the robots' values as soon as these are known.
  async step(token, steps) {
    const { text } = this.editor;
    if (this.at !== token.start) {
      this.at = token.start;
      this.spread = null;
      await this.ask();
      if (text !== this.editor.text) return; // typed on meanwhile
    }
    const [number, unit] = parsed(token.text);
    const next = stepped(number, steps, stepOf(number, this.spread), leastOf(number, this.spread));
    this.settle(token.start, token.end, next, unit);
  }

  atCaret() {
    const { caret } = this.editor;
    return this.editor.tokens.find(({ kind, start, end }) => kind === "number" && start <= caret && caret <= end) ?? null;
  }

  // ---- another number

  turn(start, number) {
    const { text } = this.editor;
    const token = this.editor.tokens.find((each) => each.start === start);
    if (!token) return;
    this.editor.turn(text.slice(0, start) + number + text.slice(token.end), start + number.length);
    this.prompt.turned();
    this.show();
  }

  // The number is what it is to be: the text is checked as one that was typed.
  settle(start, end, number, unit) {
    const { spread } = this;
    const short = number.includes(".") && !/e/i.test(number) ? number.replace(/\.?0+$/, "") : number;
    this.editor.replace(start, end, short + unit);
    this.prompt.turned();
    [this.at, this.spread] = [start, spread]; // typing has hidden it
    this.touch(start);
  }

  // ---- how the robots' values are spread

  // The box is about this number from now on.
  touch(start) {
    if (this.at !== start) this.spread = null;
    this.at = start;
    this.show();
    this.ask();
  }

  left() {
    if (this.at < 0 || this.held) return;
    const token = this.atCaret();
    if (document.activeElement === this.editor.area && token?.start !== this.at) this.hide();
  }

  hide() {
    this.at = -1;
    this.spread = null;
    this.box.hidden = true;
  }

  async ask() {
    if (this.asking || this.at < 0) return;
    const { at } = this;
    this.asking = true;
    try {
      const spread = await this.wire.ask("spread", { text: this.editor.text, at });
      if (at === this.at) this.spread = spread;
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      if (at === this.at) this.spread = null; // compared with nothing that robots know
    } finally {
      this.asking = false;
    }
    if (at === this.at) this.show();
    else this.ask();
  }

  show() {
    const token = this.editor.tokens.find(({ kind, start }) => kind === "number" && start === this.at);
    this.box.hidden = !token || !this.spread;
    if (this.box.hidden) return;
    drawSpread(this.box, this.spread, parsed(token.text)[0], token.text);
    this.place(token);
  }

  // Below the number, beside the counts; above it where there is no room.
  place(token) {
    const { box } = this;
    const desk = box.offsetParent.getBoundingClientRect();
    const counts = box.parentElement.querySelector("#unknown").parentElement.getBoundingClientRect();
    const editor = this.editor.area.getBoundingClientRect();
    const [number] = this.editor.boxes(token);
    if (!number) return;
    const free = counts.right - desk.left + 20;
    const most = desk.width - box.offsetWidth - 10;
    const beside = free <= most;
    const left = Math.max(beside ? free : 10, Math.min(number.left - desk.left - box.offsetWidth / 2, most));
    box.style.left = `${left}px`;
    const below = Math.min(counts.top - 4, window.innerHeight - box.offsetHeight - 4); // not beyond the window
    box.style.top = beside ? `${below - desk.top}px` : `${editor.top - desk.top - box.offsetHeight - 6}px`;
  }
}

// ---- numbers as they are written

// The number of a literal and its unit.
export function parsed(text) {
  const [, number, unit] = LITERAL.exec(text);
  return [number, unit];
}

// How far one step goes: a hundredth or so of the range of the robots' values, or of the number itself; 1, 2 or 5 times
// a power of ten.
export function stepOf(number, spread) {
  const value = Math.abs(Number(number));
  const range = spread ? spread.high - spread.low : 0;
  if (spread?.whole && range <= STEPS) return 1;
  const rough = range > 0 ? range / STEPS : (value || 10) / 50;
  const power = 10 ** Math.floor(Math.log10(rough));
  const lead = rough / power;
  return (lead >= 7 ? 10 : lead >= 3.5 ? 5 : lead >= 1.5 ? 2 : 1) * power;
}

// The least that a number may become: a fuel level or a distance stays 0 or more, as the robots' values do.
export function leastOf(number, spread) {
  return Number(number) >= 0 && !(spread?.low < 0) ? 0 : -Infinity;
}

// A number so many steps on, as a multiple of the step.
export function stepped(number, steps, step, least) {
  if (steps === 0) return number;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const value = Math.max(least, Math.round(Number(number) / step + steps) * step);
  return (Math.abs(value) < step / 2 ? 0 : value).toFixed(digits);
}
