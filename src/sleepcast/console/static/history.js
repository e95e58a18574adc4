// Earlier commands, kept in the browser between sessions.

import { keep, kept } from "./kept.js";

const MAX = 200; // commands kept

export class History {
  // key: under which this page's commands are kept.
  constructor(key) {
    this.key = key;
    this.items = this.load(); // oldest first
    this.at = this.items.length;
    this.draft = "";
  }

  load() {
    const items = kept(this.key, []);
    return Array.isArray(items) ? items.filter((item) => typeof item === "string").slice(-MAX) : [];
  }

  add(text) {
    const known = this.load(); // with what other pages have added
    const own = this.items.filter((item) => !known.includes(item)); // nothing, unless it could not be kept
    this.items = [...[...own, ...known].filter((item) => item !== text), text].slice(-MAX);
    this.at = this.items.length;
    this.draft = "";
    keep(this.key, this.items);
  }

  // The text one step back (-1) or forth (+1) from `text`, or null at the end.
  move(step, text) {
    if (this.at === this.items.length) this.draft = text;
    const to = this.at + step;
    if (to < 0 || to > this.items.length) return null;
    this.at = to;
    return to === this.items.length ? this.draft : this.items[to];
  }

  // Commands that contain all words of the query, latest first.
  search(query) {
    const words = query.toLowerCase().split(/\s+/).filter(Boolean);
    return this.items.filter((item) => words.every((word) => item.toLowerCase().includes(word))).reverse();
  }
}
