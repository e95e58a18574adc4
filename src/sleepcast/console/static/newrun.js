// Another run: which scenario, how many robots, which seed, and the numbers that its sliders stand for.

import { Slider } from "./slider.js";
import { Refusal } from "./wire.js";

export class NewRun {
  // wire: to the station. root: the document.
  constructor(root, wire) {
    this.wire = wire;
    this.find = (id) => root.querySelector(`#${id}`);
    this.dialog = this.find("new-run");
    this.run = 0; // the number of the run that this page was loaded for
    this.sliders = null; // those of the chosen scenario, once they are known
    this.asked = false; // whether this page has asked for another run
    this.closed = ""; // the note that somebody has closed
    this.find("renew").addEventListener("click", () => this.open());
    this.find("note-restart").addEventListener("click", () => this.start({}));
    this.find("note-close").addEventListener("click", () => {
      this.closed = this.find("note-text").textContent;
      this.find("note").hidden = true;
    });
    this.find("new-scenario").addEventListener("change", () => this.choose());
    this.find("new-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.submit();
    });
    this.find("new-close").addEventListener("click", () => this.dialog.close());
    wire.addEventListener("hello", ({ detail }) => this.greet(detail.run));
    wire.addEventListener("renewed", () => this.reload());
    wire.addEventListener("note", ({ detail }) => this.note(detail));
    wire.addEventListener("building", ({ detail }) => this.building(detail.step));
  }

  // The station shows this run: another one than this page was loaded for is another world.
  greet(run) {
    this.find("renew").hidden = run === 0;
    if (this.run && run && run !== this.run) this.reload();
    else this.run = run;
  }

  reload() {
    window.history.replaceState(null, "", window.location.pathname + window.location.search); // not the same view
    window.location.reload();
  }

  // ---- what the station says

  note({ text, restart }) {
    this.find("note-text").textContent = text;
    this.find("note-restart").hidden = !restart;
    this.find("note").hidden = !text || text === this.closed;
  }

  building(step) {
    if (this.asked && !step) return; // the answer is on its way
    this.find("building").hidden = !step;
    this.find("building-text").textContent = step ? `A new run is being built: ${step[0].toLowerCase()}${step.slice(1)} …` : "";
  }

  // ---- the dialog

  async open() {
    this.say("");
    this.find("new-start").disabled = true;
    this.dialog.showModal();
    try {
      const { scenarios, current } = await this.wire.ask("scenarios");
      const options = scenarios.map(({ name, title }) => new Option(name === title ? name : `${title} (${name})`, name));
      this.find("new-scenario").replaceChildren(...options);
      this.find("new-scenario").value = current;
      await this.choose();
    } catch (refusal) {
      this.refused(refusal);
    }
  }

  // Show what may be changed of the chosen scenario.
  async choose() {
    const scenario = this.find("new-scenario").value;
    this.say("");
    this.find("new-start").disabled = true;
    try {
      const { choices } = await this.wire.ask("setup", { scenario });
      if (scenario !== this.find("new-scenario").value) return; // another one was chosen meanwhile
      this.find("new-seed").value = choices.seed;
      this.find("new-robots").value = choices.robots;
      this.find("new-robots").disabled = choices.fixed;
      this.sliders = choices.sliders.map((slider) => new Slider(slider));
      this.find("new-sliders").replaceChildren(...this.sliders.map(({ element }) => element));
      this.find("new-start").disabled = false;
    } catch (refusal) {
      this.refused(refusal);
    }
  }

  submit() {
    this.start({
      scenario: this.find("new-scenario").value,
      seed: this.find("new-seed").value.trim(),
      robots: this.find("new-robots").disabled ? null : this.find("new-robots").valueAsNumber,
      values: Object.fromEntries(this.sliders.map(({ name, value }) => [name, value])),
    });
  }

  async start(fields) {
    this.say("");
    this.asked = true;
    this.find("new-start").disabled = true;
    this.dialog.close(); // STOP stays at hand while the run is built
    try {
      await this.wire.ask("renew", fields, Infinity);
      this.reload();
    } catch (refusal) {
      this.asked = false;
      this.building("");
      await this.open();
      this.refused(refusal);
    }
  }

  refused(refusal) {
    if (!(refusal instanceof Refusal)) throw refusal;
    this.find("new-start").disabled = !this.sliders;
    this.say(refusal.message);
  }

  say(text) {
    this.find("new-refused").textContent = text;
    this.find("new-refused").hidden = !text;
  }
}
