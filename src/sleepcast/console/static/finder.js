// The finder (Ctrl+K): one field that finds any command, robot, group, place, pane and action by its name.

import { Listbox } from "./listbox.js";

const MAX = 12; // choices offered at once

export class Finder {
  // dialog: the element. sources: functions that give choices, {kind, title, hint, run}, each time that it opens.
  constructor(dialog, sources) {
    this.dialog = dialog;
    this.sources = sources;
    this.field = dialog.querySelector("input");
    this.box = new Listbox(dialog.querySelector("ul"), this.field);
    this.choices = [];
    this.field.addEventListener("input", () => this.look());
    this.field.addEventListener("keydown", (event) => this.key(event));
    this.box.addEventListener("take", ({ detail }) => {
      dialog.close();
      detail.run();
    });
    dialog.addEventListener("click", (event) => event.target === dialog && dialog.close()); // beside it
    dialog.addEventListener("close", () => this.box.hide());
    window.addEventListener("keydown", (event) => {
      if (event.key.toLowerCase() !== "k" || !(event.ctrlKey || event.metaKey) || event.altKey || event.shiftKey) return;
      event.preventDefault();
      this.open();
    });
  }

  open() {
    if (this.dialog.open) return;
    this.choices = this.sources.flatMap((source) => source());
    this.field.value = "";
    this.dialog.showModal();
    this.look();
  }

  look() {
    this.box.show(
      matching(this.choices, this.field.value)
        .slice(0, MAX)
        .map((choice) => ({ value: choice, parts: [["kind", choice.kind], ["name", choice.title], ["doc", choice.hint ?? ""]] })),
      0,
    );
  }

  key(event) {
    if (event.key === "Enter") this.box.take();
    else if (event.key === "ArrowDown" && this.box.open) this.box.move(1);
    else if (event.key === "ArrowUp" && this.box.open) this.box.move(-1);
    else return;
    event.preventDefault();
  }
}

// Choices that contain every word of the query: first those whose title begins with it, then as they came.
export function matching(choices, query) {
  const whole = query.trim().toLowerCase();
  const words = whole.split(/\s+/).filter(Boolean);
  const rank = ({ title }) => (title.toLowerCase().startsWith(whole) ? 0 : 1);
  return choices
    .filter(({ kind, title, hint = "" }) => {
      const text = `${kind} ${title} ${hint}`.toLowerCase();
      return words.every((word) => text.includes(word));
    })
    .map((choice, place) => ({ choice, place }))
    .sort((a, b) => rank(a.choice) - rank(b.choice) || a.place - b.place)
    .map(({ choice }) => choice);
}
