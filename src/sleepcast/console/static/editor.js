// The prompt's text field: a plain textarea, and behind it the same text in colours, with the parenthesis that
// belongs to the one at the caret, and wavy lines where the checker found something.

import { partners, tokens } from "./lisp.js";

export class Editor extends EventTarget {
  // cut: finds the tokens of a text.
  constructor(area, backdrop, cut = tokens) {
    super();
    this.cut = cut;
    this.area = area;
    this.backdrop = backdrop;
    this.findings = [];
    area.addEventListener("input", () => this.changed());
    document.addEventListener("selectionchange", () => {
      if (document.activeElement === area) this.paint();
    });
    area.addEventListener("blur", () => this.paint());
    area.addEventListener("scroll", () => {
      backdrop.scrollTop = area.scrollTop;
    });
    this.changed();
  }

  get text() {
    return this.area.value;
  }

  get caret() {
    return this.area.selectionEnd;
  }

  // While locked, nobody changes the text.
  lock(locked) {
    this.area.readOnly = locked;
  }

  // Put another text in.
  set(text, caret = text.length) {
    if (this.area.readOnly) return;
    this.area.value = text;
    this.area.setSelectionRange(caret, caret);
    this.changed();
  }

  // Replace a part as if it had been typed, so that the browser's own undo knows of it.
  replace(start, end, text) {
    if (this.area.readOnly) return;
    this.area.focus();
    this.area.setSelectionRange(start, end);
    if (!document.execCommand("insertText", false, text)) {
      this.area.setRangeText(text, start, end, "end");
      this.changed();
    }
  }

  // Another text for a moment, while a number is dragged: it is not checked as one that was typed.
  turn(text, caret) {
    this.area.value = text;
    this.area.setSelectionRange(caret, caret);
    this.read();
  }

  mark(findings) {
    this.findings = findings;
    this.paint();
  }

  onFirstLine() {
    return !this.text.slice(0, this.caret).includes("\n");
  }

  onLastLine() {
    return !this.text.slice(this.caret).includes("\n");
  }

  // Where the character at an offset stands on the screen.
  place(offset) {
    const walker = document.createTreeWalker(this.backdrop, NodeFilter.SHOW_TEXT);
    let passed = 0;
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      if (passed + node.length > offset) {
        const range = document.createRange();
        range.setStart(node, offset - passed);
        range.setEnd(node, offset - passed);
        return range.getBoundingClientRect();
      }
      passed += node.length;
    }
    return this.backdrop.getBoundingClientRect();
  }

  // Where a token stands on the screen: a box for each line that it is on.
  boxes({ start, end }) {
    const walker = document.createTreeWalker(this.backdrop, NodeFilter.SHOW_TEXT);
    const range = document.createRange();
    let passed = 0;
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
      if (passed <= start && start < passed + node.length) range.setStart(node, start - passed);
      if (passed < end && end <= passed + node.length) {
        range.setEnd(node, end - passed);
        return [...range.getClientRects()];
      }
      passed += node.length;
    }
    return [];
  }

  changed() {
    this.read();
    this.dispatchEvent(new Event("change"));
  }

  read() {
    this.tokens = this.cut(this.text);
    this.pairs = partners(this.tokens);
    this.findings = [];
    this.paint();
  }

  paint() {
    const { text } = this;
    const classes = new Map(); // offset of a token to its classes
    for (const token of this.tokens) classes.set(token.start, token.kind);
    for (const at of this.atCaret()) {
      classes.set(at, `${classes.get(at)} ${this.pairs.get(at) < 0 ? "unpaired" : "pair"}`);
    }
    const ends = new Map(this.tokens.map((token) => [token.start, token.end]));
    const cuts = new Set([0, text.length]);
    for (const [start, end] of ends) cuts.add(start).add(end);
    for (const { start, end } of this.findings) cuts.add(Math.min(start, text.length)).add(Math.min(end, text.length));
    const sorted = [...cuts].sort((a, b) => a - b);
    const pieces = document.createDocumentFragment();
    let token = "";
    let tokenEnd = 0;
    for (let i = 0; i + 1 < sorted.length; i += 1) {
      const [start, end] = [sorted[i], sorted[i + 1]];
      if (classes.has(start)) [token, tokenEnd] = [classes.get(start), ends.get(start)];
      const finding = this.findings.find((each) => each.start <= start && end <= each.end);
      const span = document.createElement("span");
      span.className = `${start < tokenEnd ? token : ""} ${finding ? `found ${finding.severity}` : ""}`.trim();
      span.textContent = text.slice(start, end);
      pieces.append(span);
    }
    pieces.append("\u200b"); // keeps the height of a last, empty line
    this.backdrop.replaceChildren(pieces);
  }

  // The parenthesis before or after the caret and its partner.
  atCaret() {
    if (document.activeElement !== this.area || this.area.selectionStart !== this.area.selectionEnd) return [];
    const here = [this.caret - 1, this.caret].find((offset) => this.pairs.has(offset));
    if (here === undefined) return [];
    const there = this.pairs.get(here);
    return there < 0 ? [here] : [here, there];
  }
}
