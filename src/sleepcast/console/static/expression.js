// A small field for one expression, which completes names as the prompt does. Enter takes what stands there.

import { tokens, wordAt } from "./lisp.js";
import { Listbox } from "./listbox.js";
import { choice, fitting } from "./names.js";

const MAX_NAMES = 10; // names offered at once
const SHORTEST = 2; // characters of a word for which names are offered
const NAMES_AGE = 2000; // ms for which the names are good enough

export class ExpressionField extends EventTarget {
  // field: an input. names(): a promise of the names that a text may use, as the station tells them.
  constructor(field, names) {
    super();
    this.field = field;
    this.ask = names;
    this.names = [];
    this.askedAt = -Infinity;
    const list = document.createElement("ul");
    list.id = `${field.id}-names`;
    list.className = "completions names";
    list.hidden = true;
    list.setAttribute("role", "listbox");
    list.setAttribute("aria-label", "Names");
    field.after(list);
    field.setAttribute("role", "combobox");
    field.setAttribute("aria-autocomplete", "list");
    field.setAttribute("aria-controls", list.id);
    field.spellcheck = false;
    field.autocomplete = "off";
    field.autocapitalize = "off";
    this.box = new Listbox(list, field);
    this.box.addEventListener("take", (event) => this.complete(event.detail));
    field.addEventListener("focus", () => this.learn());
    field.addEventListener("input", () => this.offer());
    field.addEventListener("blur", () => this.box.hide());
    field.addEventListener("keydown", (event) => this.key(event));
  }

  get text() {
    return this.field.value.trim();
  }

  set(text) {
    this.field.value = text;
    this.box.hide();
  }

  async learn() {
    if (performance.now() - this.askedAt < NAMES_AGE) return;
    this.askedAt = performance.now();
    try {
      this.names = await this.ask();
    } catch {
      // Without a connection no names are offered; the text can be typed all the same.
    }
  }

  offer() {
    const word = wordAt(tokens(this.field.value), this.field.selectionEnd);
    const fits = word?.text.length >= SHORTEST ? fitting(this.names, word, MAX_NAMES) : null;
    if (!fits) {
      this.box.hide();
      return;
    }
    const brief = ({ value, parts }) => ({ value, parts: parts.slice(0, -1) }); // the field is too small for the explanation
    this.box.show(fits.map(choice).map(brief));
    this.place();
  }

  // The list lies over everything: the pane around the field would cut it off.
  place() {
    const { list } = this.box;
    const at = this.field.getBoundingClientRect();
    const below = window.innerHeight - at.bottom > list.offsetHeight + 8;
    list.style.left = `${Math.max(8, Math.min(at.left, window.innerWidth - list.offsetWidth - 8))}px`;
    list.style.top = `${below ? at.bottom + 4 : Math.max(8, at.top - list.offsetHeight - 4)}px`;
  }

  complete(name) {
    const { field } = this;
    const word = wordAt(tokens(field.value), field.selectionEnd);
    if (word) field.setRangeText(name, word.start, word.end, "end");
    field.focus();
  }

  key(event) {
    if (event.isComposing) return;
    if (this.box.open) {
      if (event.key === "ArrowDown") this.box.move(1);
      else if (event.key === "ArrowUp") this.box.move(-1);
      else if (event.key === "Tab" && !event.shiftKey) this.box.take();
      else if (event.key === "Enter" && this.box.at >= 0) this.box.take();
      else if (event.key === "Escape") this.box.hide();
      else if (event.key !== "Enter") return;
      else return this.take(event);
      event.preventDefault();
      event.stopPropagation();
    } else if (event.key === "Enter") this.take(event);
  }

  take(event) {
    event.preventDefault();
    this.box.hide();
    this.dispatchEvent(new CustomEvent("take", { detail: this.text }));
  }
}
