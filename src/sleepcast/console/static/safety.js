// STOP and RELEASE. STOP has one key that nobody types by accident, asks nothing and works everywhere on the page.

export const STOP_KEY = "F9";

export class Safety {
  constructor(root, wire) {
    this.wire = wire;
    this.find = (id) => root.querySelector(`#${id}`);
    this.unsent = false; // STOP was pressed while there was no connection
    this.find("stop").addEventListener("click", () => this.stop());
    this.find("release").addEventListener("click", () => this.release());
    window.addEventListener(
      "keydown",
      (event) => {
        if (event.key !== STOP_KEY || event.repeat) return;
        event.preventDefault();
        event.stopPropagation();
        this.stop();
      },
      true,
    );
  }

  stop() {
    this.find("stop").classList.add("pressed");
    setTimeout(() => this.find("stop").classList.remove("pressed"), 250);
    if (this.wire.tell("stop")) return;
    this.unsent = true;
    this.say("STOP could not be sent: there is no connection to the station. It goes out as soon as there is one.");
  }

  release() {
    this.unsent = false;
    if (!this.wire.tell("release")) this.say("RELEASE could not be sent: there is no connection to the station.");
  }

  connected() {
    if (this.unsent && this.wire.tell("stop")) this.unsent = false;
  }

  // What the station says: {latched, sentence}.
  show(news) {
    this.find("stopped").hidden = !news.latched;
    document.body.classList.toggle("latched", news.latched);
    if (news.latched) this.say(news.sentence);
  }

  say(text) {
    this.find("stopped").hidden = false;
    if (this.find("stopped-text").textContent !== text) this.find("stopped-text").textContent = text;
  }
}
