// About the chosen robot: which one it is, its numbers in the Nomad's units, what it was told and what it said.

import { palette } from "../shapes.js";
import { colourOf } from "./drawing.js";
import { make, write } from "../elements.js";

const TABS = ["said", "commands"];
const NONE = {
  said: "It has said nothing. A program says something with tk.",
  commands: "Nobody has told it anything yet.",
};
const WHEELS = ["right", "left"]; // the axes of a body on two wheels
const STEERED = ["way", "steering", "turret"]; // and of one that steers its wheels together
const MANY = 8; // robots, beyond which their buttons say less
const MOST_SHOWN = 100; // lines

export class About extends EventTarget {
  constructor(root, state) {
    super();
    this.state = state;
    this.find = (id) => root.querySelector(`#${id}`);
    this.lists = {};
    for (const name of TABS) {
      this.find(`tab-${name}`).addEventListener("click", () => this.open(name));
      this.find(`tab-${name}`).addEventListener("keydown", (event) => {
        if (event.key !== "ArrowRight" && event.key !== "ArrowLeft") return;
        const other = TABS[1 - TABS.indexOf(name)];
        this.open(other);
        this.find(`tab-${other}`).focus();
        event.preventDefault();
      });
    }
  }

  // One button for each robot.
  offer() {
    const { kinds, chosen } = this.state;
    const colours = palette();
    this.find("chooser").classList.toggle("many", kinds.length > MANY);
    this.find("chooser").replaceChildren(
      ...kinds.map(({ name }, robot) => {
        const button = make("button", { type: "button" }, dot(colourOf(robot, colours)), name);
        button.setAttribute("role", "radio");
        button.setAttribute("aria-checked", String(robot === chosen));
        button.tabIndex = robot === chosen ? 0 : -1;
        button.setAttribute("aria-label", `Robot ${name}`);
        button.addEventListener("click", () => this.ask(robot));
        button.addEventListener("keydown", (event) => {
          const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
          if (!step) return;
          event.preventDefault();
          this.ask((robot + step + kinds.length) % kinds.length);
          this.find("chooser").children[this.state.chosen].focus();
        });
        return button;
      }),
    );
  }

  ask(robot) {
    this.dispatchEvent(new CustomEvent("choose", { detail: robot }));
  }

  choose() {
    [...this.find("chooser").children].forEach((button, robot) => {
      button.setAttribute("aria-checked", String(robot === this.state.chosen));
      button.tabIndex = robot === this.state.chosen ? 0 : -1;
    });
    this.find("robot-name").textContent = `Robot ${this.state.kind?.name ?? ""}`;
    this.lists = {};
  }

  open(name) {
    for (const each of TABS) {
      const chosen = each === name;
      this.find(`tab-${each}`).setAttribute("aria-selected", String(chosen));
      this.find(`tab-${each}`).tabIndex = chosen ? 0 : -1;
      this.find(`pane-${each}`).hidden = !chosen;
    }
  }

  show() {
    const { state } = this;
    const { robot, own } = state;
    if (!robot) return;
    write(this.find("robot-state"), robot.client ? `driven by ${robot.client}` : "no program drives it");
    this.find("contest").hidden = !robot.rivals;
    if (robot.rivals) write(this.find("contest"), `Driven by ${robot.rivals}: each replaces what the other asks.`);
    this.row("believed", robot.believed);
    this.row("real", robot.real);
    [...this.find("chooser").children].forEach((button, index) => {
      button.classList.toggle("asks", state.robots[index]?.waiting ?? false);
      button.classList.toggle("rivals", Boolean(state.robots[index]?.rivals));
      button.classList.toggle("driven", Boolean(state.robots[index]?.client));
    });
    this.find("asked").hidden = !robot.waiting;
    if (robot.waiting) write(this.find("asked"), "A program asks for a place: click one here, or press Enter for the middle.");
    if (!own) return;
    const { steers } = state.kind;
    const speeds = (steers ? STEERED : WHEELS).map((name, axis) => {
      const turns = steers && axis > 0;
      return `${name} ${turns ? Math.round(own.speeds[axis] / state.degree) : state.tenths(own.speeds[axis])}`;
    });
    const motion = own.moving.some(Boolean) ? "moving" : "standing";
    const battery = `battery ${Math.round(100 * own.battery)}\u00a0%`;
    write(this.find("motion"), [`speeds ${speeds.join(", ")}`, motion, battery].join(" · "));
    for (const name of TABS) this.list(name, state[name]);
  }

  row(id, pose) {
    const { state } = this;
    const texts = [state.tenths(pose[0]), state.tenths(pose[1]), state.direction(pose[2]), state.direction(pose[3])];
    texts.forEach((text, place) => write(this.find(id).cells[place + 1], String(text)));
  }

  // The newest line is at the top.
  list(name, lines) {
    const last = lines.at(-1);
    const before = this.lists[name];
    if (before && before.last === last && before.length === lines.length) return;
    this.lists[name] = { last, length: lines.length };
    const pane = this.find(`pane-${name}`);
    if (!lines.length) {
      pane.replaceChildren(make("p", { className: "empty" }, NONE[name]));
      return;
    }
    const newest = lines.slice(-MOST_SHOWN).reverse();
    pane.replaceChildren(
      make("ol", {}, ...newest.map(([time, text]) => make("li", {}, make("time", {}, `${time.toFixed(1)} s`), text))),
    );
  }
}

// A disc in a robot's colour.
function dot(colour) {
  const element = make("span", { className: "dot", ariaHidden: "true" });
  element.style.background = colour;
  return element;
}
