// Obstacles as a file: those of one that is loaded, and a file with those that there are.

import { download } from "../files.js";

const MAX = 100_000; // characters, as console/incoming.py has it
const LONGEST_NAME = 200;

export class WorldFile extends EventTarget {
  constructor(root, wire) {
    super();
    this.wire = wire;
    this.file = root.querySelector("#file");
    root.querySelector("#load").addEventListener("click", () => this.file.click());
    root.querySelector("#save").addEventListener("click", () => this.save());
    this.file.addEventListener("change", () => this.load());
  }

  async load() {
    const [file] = this.file.files;
    if (!file) return;
    const text = file.size <= MAX ? await file.text() : "";
    this.file.value = ""; // so that the same file may be chosen once more
    if (file.size > MAX) this.tell(`${file.name} has more than ${MAX} bytes: start the server with it`, true);
    else this.ask("load", { name: file.name.slice(0, LONGEST_NAME), text }, () => `The obstacles are those of ${file.name}.`);
  }

  save() {
    this.ask("save", {}, ({ text }) => {
      download("world.txt", "text/plain", [text]);
      return "The obstacles were saved as world.txt.";
    });
  }

  // Ask the server, and tell what `done` makes of its answer.
  ask(kind, fields, done) {
    this.wire.ask(kind, fields).then(
      (answer) => this.tell(done(answer), false),
      (refusal) => this.tell(refusal.message, true),
    );
  }

  tell(text, wrong) {
    this.dispatchEvent(new CustomEvent("told", { detail: { text, wrong } }));
  }
}
