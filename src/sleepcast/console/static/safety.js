// STOP and RELEASE. STOP has one key that nobody types by accident, asks nothing and works everywhere on the page.

import { write } from "./elements.js";

export const STOP_KEY = "F9";

const PATIENCE = 1000; // ms within which the station says that it has heard STOP

export class Safety {
  constructor(root, wire) {
    this.wire = wire;
    this.find = (id) => root.querySelector(`#${id}`);
    this.latched = false; // what the station said last
    this.pressed = false; // STOP was, and the station has said nothing of it
    this.timer = 0;
    this.find("stop").addEventListener("click", () => this.press());
    this.find("release").addEventListener("click", () => this.release());
    window.addEventListener(
      "keydown",
      (event) => {
        if (event.key !== STOP_KEY || event.repeat) return;
        event.preventDefault();
        event.stopPropagation();
        this.press();
      },
      true,
    );
    wire.addEventListener("hello", () => this.pressed && this.stop()); // it may be lost, or was never sent
    wire.addEventListener("safety", ({ detail }) => this.show(detail));
    wire.addEventListener("refused", () => this.answered());
  }

  press() {
    this.find("stop").classList.add("pressed");
    setTimeout(() => this.find("stop").classList.remove("pressed"), 250);
    this.stop();
  }

  stop() {
    const sent = this.wire.tell("stop", this.by);
    if (sent && this.latched) return; // said once more, and all is known
    this.answered();
    this.pressed = true;
    const unheard = "STOP was sent, but the station has not confirmed it. Do not rely on it.";
    if (sent) this.timer = setTimeout(() => this.say(unheard), PATIENCE);
    else this.say("STOP could not be sent: there is no connection to the station. It goes out as soon as there is one.");
  }

  // The operator as whom it goes out, where the run names any.
  get by() {
    const chosen = this.find("by")?.value;
    return chosen ? { by: chosen } : {};
  }

  answered() {
    clearTimeout(this.timer);
    this.pressed = false;
    this.find("stopped").hidden = !this.latched;
  }

  release() {
    this.answered();
    if (!this.wire.tell("release", this.by)) this.say("RELEASE could not be sent: there is no connection to the station.");
  }

  // What the station says: {latched, sentence, noticed}.
  show(news) {
    // What a person should know of stands there with STOP and without.
    this.find("noticed").hidden = !news.noticed;
    this.find("noticed").title = news.noticed; // the line may be too short for it
    write(this.find("noticed-text"), news.noticed);
    this.latched = news.latched;
    document.body.classList.toggle("latched", news.latched);
    if (news.latched) {
      this.answered();
      this.say(news.sentence);
    } else if (!this.pressed) this.find("stopped").hidden = true;
  }

  say(text) {
    this.find("stopped").hidden = false;
    write(this.find("stopped-text"), text);
  }
}
