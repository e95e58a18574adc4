// One button for each robot, with what becomes of it: driven by a program, by several, or asking for a place.

import { make } from "../elements.js";
import { colourOf } from "../shapes.js";

const MANY = 8; // robots, beyond which their buttons say less

// "choose" is dispatched with the index of a robot.
export class Chooser extends EventTarget {
  constructor(root) {
    super();
    this.root = root;
    this.chosen = 0;
  }

  offer(names, colours) {
    this.root.classList.toggle("many", names.length > MANY);
    this.root.replaceChildren(
      ...names.map((name, robot) => {
        const button = make("button", { type: "button" }, dot(colourOf(robot, colours)), name);
        button.setAttribute("role", "radio");
        button.setAttribute("aria-label", `Robot ${name}`);
        button.addEventListener("click", () => this.ask(robot));
        button.addEventListener("keydown", (event) => {
          const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
          if (!step) return;
          event.preventDefault();
          this.ask((robot + step + names.length) % names.length);
          this.root.children[this.chosen].focus();
        });
        return button;
      }),
    );
    this.choose(this.chosen);
  }

  ask(robot) {
    this.dispatchEvent(new CustomEvent("choose", { detail: robot }));
  }

  choose(chosen) {
    this.chosen = chosen;
    [...this.root.children].forEach((button, robot) => {
      button.setAttribute("aria-checked", String(robot === chosen));
      button.tabIndex = robot === chosen ? 0 : -1;
    });
  }

  // robots: as of windows.js.
  show(robots) {
    [...this.root.children].forEach((button, index) => {
      button.classList.toggle("asks", robots[index]?.waiting ?? false);
      button.classList.toggle("rivals", Boolean(robots[index]?.rivals));
      button.classList.toggle("driven", Boolean(robots[index]?.client));
    });
  }
}

// A disc in a robot's colour.
function dot(colour) {
  const element = make("span", { className: "dot", ariaHidden: "true" });
  element.style.background = colour;
  return element;
}
