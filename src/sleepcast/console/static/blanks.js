// Sliders for the numbers of a ready-made command, as long as it stands in the prompt as it was made.

import { Slider } from "./slider.js";

export class Blanks {
  // root: where the sliders are.
  constructor(root, prompt) {
    this.root = root;
    this.prompt = prompt;
    this.sliders = new Map(); // by name
    this.commands = [];
    this.shown = null; // the command whose sliders are there
    prompt.editor.addEventListener("change", () => this.look());
  }

  // commands: ready-made ones, with names in braces in their `blank`. numbers: those names.
  set(commands, numbers) {
    this.commands = commands;
    this.sliders = new Map(numbers.map((number) => [number.name, new Slider(number)]));
    for (const slider of this.sliders.values()) slider.addEventListener("input", () => this.fill());
    this.shown = null;
    this.look();
  }

  // Show the sliders of the command that stands in the prompt.
  look() {
    const { text } = this.prompt.editor;
    const command = this.commands.find((each) => each.blank && each.text === text) ?? null;
    if (command === this.shown) return;
    this.shown = command;
    this.root.hidden = !command;
    const named = command ? [...this.sliders.values()].filter(({ name }) => command.blank.includes(`{${name}}`)) : [];
    this.root.replaceChildren(...named.map(({ element }) => element));
  }

  // A slider was moved: all commands have its number now.
  fill() {
    const { shown } = this;
    for (const command of this.commands) {
      if (command.blank) command.text = command.blank.replace(/\{(\w+)\}/g, (whole, name) => this.sliders.get(name)?.text ?? whole);
    }
    this.prompt.setReady(this.commands);
    this.prompt.set(shown.text, false);
  }
}
