// Earlier commands, kept in the browser between sessions.

const MOST = 200; // commands kept

export class History {
  // key: under which this page's commands are kept.
  constructor(key) {
    this.key = key;
    this.items = this.load(); // oldest first
    this.at = this.items.length;
    this.draft = "";
  }

  load() {
    try {
      const found = JSON.parse(window.localStorage.getItem(this.key) ?? "[]");
      return Array.isArray(found) ? found.filter((item) => typeof item === "string").slice(-MOST) : [];
    } catch {
      return []; // storage is forbidden, or something else wrote there: start anew
    }
  }

  add(text) {
    const kept = this.load(); // with what other pages have added
    const own = this.items.filter((item) => !kept.includes(item)); // nothing, unless it could not be kept
    this.items = [...[...own, ...kept].filter((item) => item !== text), text].slice(-MOST);
    this.at = this.items.length;
    this.draft = "";
    try {
      window.localStorage.setItem(this.key, JSON.stringify(this.items));
    } catch {
      // A full or forbidden storage only means that the history ends with this session.
    }
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
