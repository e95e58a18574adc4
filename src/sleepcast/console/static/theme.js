// Light or dark: as the system has it, until somebody presses the button; that is kept.

import { keep, kept } from "./kept.js";

const KEY = "theme";

// changed: called whenever the colours are other ones, and once at the start.
export function theme(button, changed) {
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  const set = (name) => {
    document.documentElement.dataset.theme = name;
    changed();
  };
  button.addEventListener("click", () => {
    const name = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    set(name);
    keep(KEY, name);
  });
  dark.addEventListener("change", () => chosen() ?? set(dark.matches ? "dark" : "light"));
  set(chosen() ?? (dark.matches ? "dark" : "light"));
}

// The same for a page in a notebook, whose widget says which it is; the button has nothing to do.
export function givenTheme(button, changed) {
  button.hidden = true;
  window.addEventListener("message", ({ source, data }) => {
    if (source !== window.parent || !data?.theme) return;
    document.documentElement.dataset.theme = data.theme;
    changed();
  });
}

function chosen() {
  const name = kept(KEY, null);
  return name === "dark" || name === "light" ? name : null;
}
