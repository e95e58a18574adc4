// The legend: which look is which group, colour or kind, and how many robots have it. A line lights its robots, and its
// Follow keeps them in the middle. On a narrow screen it is folded to one line.

import { bytes } from "./accounting.js";
import { hide, write } from "./elements.js";
import { colourName, CRASHED } from "./frame.js";
import { keep, kept } from "./kept.js";
import { colourCounts, LOOKS, lookOfColour, lookOfGroup, lookOfKind, picture, KINDS } from "./shapes.js";
import { Refusal } from "./wire.js";

const REFRESH = 500; // ms between two looks at who is in the lit line
const NARROW = window.matchMedia("(max-width: 40rem)");
const FOLD = "legend-folded";

export class Legend extends EventTarget {
  // world: {scene, frame, looks, colours, ofRobots} as of world.js
  constructor(root, wire, world) {
    super();
    this.fold = root.querySelector("#legend-fold");
    this.list = root.querySelector("#legend-lines");
    this.wire = wire;
    this.world = world;
    this.groups = []; // {name, count, shown}, in the order of their codes in a frame
    this.items = new Map(); // what stands in the list, by key
    this.chosen = null; // {key, kind, value, text} of the lit line
    this.following = false;
    this.looked = 0;
    this.folded = kept(FOLD, null) ?? NARROW.matches;
    this.fold.addEventListener("click", () => {
      this.folded = !this.folded;
      keep(FOLD, this.folded);
      this.showFold();
    });
    this.showFold();
  }

  setGroups(groups) {
    this.groups = groups;
  }

  // A frame has come: counts of colours and sorts, and who is lit, may be others.
  tick(now) {
    if (now - this.looked < REFRESH) return;
    this.looked = now;
    const { frame, scene } = this.world;
    if (frame.colours || scene.sorts.length || this.items.size > 1 || this.crashed()) this.draw(this.lit);
    if (this.chosen) this.tell();
  }

  // lit: {caption, count} of robots that are lit for another reason, or null.
  draw(lit) {
    this.lit = lit;
    const lines = this.lines();
    const last = lit ? [{ key: "lit", icon: "glow", count: lit.count, text: lit.caption }] : [];
    const items = [...lines, ...last].map((line) => this.item(line));
    for (const [key, item] of this.items) if (!items.includes(item)) this.items.delete(key);
    if (items.some((item, index) => this.list.children[index] !== item) || items.length !== this.list.children.length) {
      this.list.replaceChildren(...items);
    }
    write(this.fold, this.summary());
    hide(this.fold, lines.length < 2);
    if (this.chosen && !this.items.has(this.chosen.key)) this.choose(null);
  }

  // One line in place of all.
  summary() {
    const { scene, frame, looks } = this.world;
    const count = frame?.count === scene.count ? this.world.ofRobots(looks.bodies).length : scene.count;
    const groups = this.groups.filter((group) => group.count).length;
    const parts = [`${count.toLocaleString("en")} ${scene.noun}`];
    if (groups) parts.push(groups === 1 ? "1 group" : `${groups} groups`);
    const crashed = this.crashed();
    if (crashed) parts.push(`${crashed.toLocaleString("en")} crashed`);
    return parts.join(" · ");
  }

  // How many robots have crashed.
  crashed() {
    return this.world.frame?.flags.reduce((sum, flags) => sum + (flags & CRASHED ? 1 : 0), 0) ?? 0;
  }

  // {key, look or icon, count, text, and kind and value where it can be lit}
  lines() {
    const { scene, frame, looks } = this.world;
    const known = frame?.count === scene.count;
    const bodies = counts(known ? this.world.ofRobots(looks.bodies) : [], LOOKS);
    const colours = known && frame.colours ? colourCounts(frame) : [];
    const lines = [];
    this.groups.forEach((group, index) => {
      if (group.count) lines.push(line("group", index + 1, lookOfGroup(index + 1), group.count, group.name));
    });
    colours.forEach((count, colour) => {
      if (colour && count) lines.push(line("colour", colour, lookOfColour(colour), count, colourName(colour)));
    });
    const grouped = this.groups.some((group) => group.count);
    const rest = !lines.length ? scene.noun : !grouped ? "showing no colour" : colours.length ? "others" : "in no group";
    const kinds = scene.sorts.length ? scene.sorts.map((name, kind) => [kind, name]) : [[0, rest]];
    const plain = kinds.slice(0, KINDS).map(([kind, name]) => {
      const look = lookOfKind(kind);
      return line("sort", look, look, known ? bodies[look] : kind ? 0 : scene.count, name);
    });
    const there = plain.filter(({ count }) => count);
    const first = there.length || lines.length ? there : plain.slice(0, 1);
    const crashed = this.crashed();
    if (crashed) lines.push({ key: "crashed", kind: "crashed", icon: "crashed", count: crashed, text: "crashed" });
    if (scene.unheard) lines.push({ key: "unheard", count: scene.unheard, text: "never heard" });
    return [...first, ...lines];
  }

  // The list's item of this key, made to say this.
  item(line) {
    const { key, count, text } = line;
    let item = this.items.get(key);
    if (!item) {
      item = document.createElement("li");
      item.classList.toggle("lit", key === "lit");
      const hold = line.kind ? Object.assign(document.createElement("button"), { type: "button" }) : item;
      if (line.kind) {
        hold.title = "Highlight these robots";
        hold.addEventListener("click", () => this.choose(this.chosen?.key === key ? null : line));
        item.append(hold);
      }
      hold.append(document.createElement("span"), document.createElement("b"), document.createElement("span"));
      this.items.set(key, item);
    }
    const hold = item.querySelector("button") ?? item;
    const [icon, number, words] = hold.children;
    const shown = count.toLocaleString("en");
    write(number, shown);
    write(words, ` ${text}`);
    icon.className = line.icon ?? "";
    if (line.look !== undefined && item.drawn !== this.world.colours) {
      item.drawn = this.world.colours; // of another theme, or not drawn yet
      icon.replaceChildren(picture(line.look, this.world.colours));
    }
    if (line.kind) this.press(item, key);
    return item;
  }

  press(item, key) {
    const chosen = this.chosen?.key === key;
    item.querySelector("button").setAttribute("aria-pressed", String(chosen));
    item.querySelector(".legend-follow")?.setAttribute("aria-pressed", String(this.following));
    if (chosen === (item.children.length > 1)) return;
    if (!chosen) {
      item.lastChild.remove();
      return;
    }
    const follow = Object.assign(document.createElement("button"), { type: "button", className: "legend-follow" });
    follow.textContent = "Follow";
    follow.title = "Keep these robots in the middle";
    follow.setAttribute("aria-pressed", String(this.following));
    follow.addEventListener("click", () => this.follow(!this.following));
    item.append(follow);
  }

  showFold() {
    this.fold.setAttribute("aria-expanded", String(!this.folded));
    this.fold.parentElement.classList.toggle("folded", this.folded);
  }

  // ---- lighting and following

  choose(line) {
    if (this.chosen === line) return;
    this.chosen = line;
    if (!line) this.follow(false);
    for (const [key, item] of this.items) if (item.querySelector("button")) this.press(item, key);
    if (line) this.tell();
    else this.dispatchEvent(new CustomEvent("light", { detail: null }));
  }

  // Something else is lit now.
  forget() {
    if (!this.chosen) return;
    this.chosen = null;
    this.follow(false);
    this.draw(this.lit);
  }

  follow(on) {
    if (on === this.following) return;
    this.followed(on);
    this.dispatchEvent(new CustomEvent("follow", { detail: on }));
  }

  // Whether the map follows the lit robots; somebody may have moved it.
  followed(on) {
    this.following = on;
    const item = this.chosen && this.items.get(this.chosen.key);
    if (item) this.press(item, this.chosen.key);
  }

  // Say who the robots of the lit line are now.
  async tell() {
    const { chosen } = this;
    try {
      const marks = await this.members(chosen);
      if (chosen === this.chosen) this.dispatchEvent(new CustomEvent("light", { detail: { marks } }));
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal; // else the next look tells
    }
  }

  async members({ kind, value }) {
    const { frame, looks } = this.world;
    if (kind === "group") {
      const { members } = await this.wire.ask("members", { group: value });
      return bytes(members);
    }
    if (kind === "crashed") return frame.flags.map((flags) => (flags & CRASHED ? 1 : 0));
    if (kind === "colour") return marked(frame.colours ?? new Uint8Array(frame.count), value);
    return marked(looks.bodies, value);
  }
}

function line(kind, value, look, count, text) {
  return { key: `${kind}:${value}`, kind, value, look, count, text };
}

function counts(codes, most) {
  const counts = new Array(most).fill(0);
  for (const code of codes) counts[code] += 1;
  return counts;
}

function marked(codes, wanted) {
  return codes.map((code) => (code === wanted ? 1 : 0));
}
