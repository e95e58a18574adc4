// The drawer: wide panes between the map and the prompt. A row of tabs is always there; a pane takes room only while it
// is open. Which one is open, and how high it is, is remembered.

import { keep, kept } from "./kept.js";
import { splitter } from "./splitter.js";

const LEAST = 120; // pixels of an open pane
const MAP = 180; // pixels that are left for the map

export class Drawer extends EventTarget {
  constructor(root) {
    super();
    this.root = root;
    this.tabs = root.querySelector(".drawer-tabs");
    this.body = root.querySelector(".drawer-body");
    this.panes = new Map(); // by name: {tab, element, shown}
    this.current = ""; // the name of the open pane
    this.wanted = kept("pane", "");
    splitter(root.querySelector(".splitter"), {
      name: "pane-height",
      vertical: true,
      read: () => this.body.offsetHeight,
      apply: (height) => this.setHeight(height),
    });
    this.tabs.addEventListener("keydown", (event) => this.key(event));
  }

  // Add a pane. element: what it shows. shown(open): told when it opens and closes, so that it asks for nothing unseen.
  add({ name, title, element, shown = () => {} }) {
    const tab = document.createElement("button");
    tab.type = "button";
    tab.id = `drawer-${name}`;
    tab.textContent = title;
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-selected", "false");
    tab.addEventListener("click", () => this.toggle(name));
    element.setAttribute("role", "tabpanel");
    element.setAttribute("aria-labelledby", tab.id);
    element.hidden = true;
    this.tabs.append(tab);
    this.body.append(element);
    this.panes.set(name, { tab, element, shown });
    this.root.hidden = false;
    this.reachable();
    if (name === this.wanted) this.open(name);
  }

  toggle(name) {
    if (name === this.current) this.close();
    else this.open(name);
  }

  open(name) {
    if (!this.panes.has(name) || name === this.current) return;
    this.show(this.current, false);
    this.current = name;
    this.root.classList.add("open");
    this.show(name, true);
    keep("pane", name);
    this.reachable();
    this.dispatchEvent(new CustomEvent("change", { detail: name }));
  }

  close() {
    if (!this.current) return;
    this.show(this.current, false);
    this.current = "";
    this.root.classList.remove("open");
    keep("pane", "");
    this.reachable();
    this.dispatchEvent(new CustomEvent("change", { detail: "" }));
  }

  show(name, open) {
    const pane = this.panes.get(name);
    if (!pane) return;
    pane.element.hidden = !open;
    pane.tab.setAttribute("aria-selected", String(open));
    pane.shown(open);
  }

  // The keyboard reaches one tab: the open one, else the first.
  reachable() {
    const at = this.panes.has(this.current) ? this.current : this.panes.keys().next().value;
    for (const [name, { tab }] of this.panes) tab.tabIndex = name === at ? 0 : -1;
  }

  setHeight(height) {
    const most = this.root.parentElement.clientHeight - MAP;
    this.body.style.height = `${Math.max(LEAST, Math.min(height, Math.max(LEAST, most)))}px`;
  }

  key(event) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    const tabs = [...this.tabs.children];
    if (event.key === "Escape") this.close();
    else if (step) tabs[(tabs.indexOf(event.target) + step + tabs.length) % tabs.length].focus();
    else return;
    event.preventDefault();
  }
}
