// Obstacles: drawn corner by corner, chosen, moved, taken away.

import { encloses } from "../polygon.js";
import { outline } from "./drawing.js";

const CLOSE = 10; // pixels: a click so near to the first corner ends the polygon
const MOST_CORNERS = 64; // as console/nomads/incoming.py has it

export class Builder extends EventTarget {
  constructor(root, state, pane) {
    super();
    this.state = state;
    this.pane = pane;
    this.find = (id) => root.querySelector(`#${id}`);
    this.corners = null; // of the polygon that is drawn, x, y in m; null while none is
    this.pointer = null; // where the next corner would be
    this.chosen = -1; // the place of an obstacle among the solids
    this.shift = null; // how far the chosen one is being dragged, m
    this.find("build").addEventListener("click", () => (this.drawing ? this.end() : this.begin()));
    this.find("demolish").addEventListener("click", () => this.demolish());
  }

  get drawing() {
    return this.corners !== null;
  }

  begin() {
    this.choose(-1);
    this.corners = [];
    this.say("Click the corners. The first one again, or Enter, puts the obstacle up; Escape gives it up.");
    this.find("build").setAttribute("aria-pressed", "true");
    this.pane.box.classList.add("drawing");
    this.pane.box.focus();
  }

  end() {
    this.corners = this.pointer = null;
    this.say("");
    this.find("build").setAttribute("aria-pressed", "false");
    this.pane.box.classList.remove("drawing");
    this.pane.repaint("robots");
  }

  finish() {
    if (this.corners.length < 3) {
      this.say("An obstacle has three corners at least.");
      return;
    }
    this.dispatchEvent(new CustomEvent("ask", { detail: ["build", { corners: this.corners }] }));
    this.end();
  }

  say(text) {
    this.find("guidance").hidden = !text;
    this.find("guidance").textContent = text;
  }

  // ---- choosing

  // The obstacles are other ones: what was chosen may not be there any more.
  renew() {
    this.choose(-1);
  }

  choose(place) {
    this.chosen = place;
    this.shift = null;
    this.find("demolish").hidden = place < 0;
    this.pane.repaint("ground", "robots");
  }

  demolish() {
    if (this.chosen < 0) return;
    const detail = ["clear", { version: this.state.version, solid: this.chosen }];
    this.dispatchEvent(new CustomEvent("ask", { detail }));
  }

  // The obstacle under the pixel, or -1.
  at(px, py) {
    const [x, y] = this.pane.view.toWorld(px, py);
    return this.state.solids.findLastIndex((corners) => encloses(corners.flat(), x, y));
  }

  // ---- hands

  // Whether the click was a corner.
  click(px, py) {
    if (!this.drawing) return false;
    const { view } = this.pane;
    const [first] = this.corners;
    const closes = first && Math.hypot(view.toScreenX(first[0]) - px, view.toScreenY(first[1]) - py) < CLOSE;
    if (closes) this.finish();
    else if (this.corners.length < MOST_CORNERS) this.corners.push(view.toWorld(px, py));
    this.pane.repaint("robots");
    return true;
  }

  hover(px, py) {
    if (!this.drawing) return;
    this.pointer = this.pane.view.toWorld(px, py);
    this.pane.repaint("robots");
  }

  grab(px, py) {
    if (this.chosen < 0 || this.at(px, py) !== this.chosen) return null;
    const [x0, y0] = this.pane.view.toWorld(px, py);
    return {
      move: (nowX, nowY) => {
        const [x, y] = this.pane.view.toWorld(nowX, nowY);
        this.shift = [x - x0, y - y0];
        this.pane.repaint("robots");
      },
      drop: (moved) => {
        const { shift, chosen: solid, state } = this;
        this.shift = null;
        if (!moved || !shift) return;
        const detail = ["shift", { version: state.version, solid, across: shift[0], up: shift[1] }];
        this.dispatchEvent(new CustomEvent("ask", { detail }));
      },
    };
  }

  key(event) {
    if (this.drawing) {
      if (event.key === "Enter") this.finish();
      else if (event.key === "Escape") this.end();
      else if (event.key === "Backspace") this.corners.pop();
      else return false;
      this.pane.repaint("robots");
      return true;
    }
    if (this.chosen < 0) return false;
    if (event.key === "Delete" || event.key === "Backspace") this.demolish();
    else if (event.key === "Escape") this.choose(-1);
    else return false;
    return true;
  }

  // ---- drawing

  draw(pen, view, colours) {
    if (this.shift && this.state.solids[this.chosen]) {
      const [dx, dy] = this.shift;
      outline(pen, view, this.state.solids[this.chosen].map(([x, y]) => [x + dx, y + dy]));
      pen.setLineDash([6, 4]);
      pen.strokeStyle = colours.chosen;
      pen.lineWidth = 2;
      pen.stroke();
      pen.setLineDash([]);
    }
    if (!this.drawing) return;
    pen.beginPath();
    for (const [x, y] of this.pointer ? [...this.corners, this.pointer] : this.corners) {
      pen.lineTo(view.toScreenX(x), view.toScreenY(y));
    }
    pen.strokeStyle = pen.fillStyle = colours.chosen;
    pen.lineWidth = 2;
    pen.stroke();
    for (const [x, y] of this.corners) pen.fillRect(view.toScreenX(x) - 4, view.toScreenY(y) - 4, 8, 8);
  }
}
