// The search in earlier commands: a field of its own over the prompt, and what was found under it.

import { Listbox } from "./listbox.js";

const MAX_FOUND = 8; // commands offered

export class Search extends EventTarget {
  constructor(root, history) {
    super();
    this.pane = root.querySelector("#search");
    this.field = root.querySelector("#search-text");
    this.history = history;
    this.results = new Listbox(root.querySelector("#search-found"), this.field);
    this.field.addEventListener("input", () => this.look());
    this.field.addEventListener("keydown", (event) => this.key(event));
    this.field.addEventListener("blur", () => this.hide());
    this.results.addEventListener("take", (event) => {
      this.hide();
      this.dispatchEvent(new CustomEvent("take", { detail: event.detail }));
    });
  }

  begin() {
    this.pane.hidden = false;
    this.field.value = "";
    this.field.focus();
    this.look();
  }

  look() {
    const texts = this.history.search(this.field.value).slice(0, MAX_FOUND);
    this.results.show(texts.map((text) => ({ value: text, parts: [["text", text.replace(/\s+/g, " ")]] })), 0);
  }

  key(event) {
    if (event.key === "Enter") this.results.take();
    else if (event.key === "Escape") {
      this.hide();
      this.dispatchEvent(new Event("end"));
    } else if (this.results.open && (event.key === "ArrowDown" || (event.key === "r" && event.ctrlKey))) this.results.move(1);
    else if (this.results.open && event.key === "ArrowUp") this.results.move(-1);
    else return;
    event.preventDefault();
  }

  hide() {
    this.pane.hidden = true;
    this.results.hide();
  }
}
