// What the page remembers in this browser between two visits. A browser may refuse to keep anything.

const PREFIX = "sleepcast.";

// What is kept under a name, `otherwise` if there is nothing that can be read.
export function kept(name, otherwise) {
  try {
    return JSON.parse(localStorage.getItem(PREFIX + name)) ?? otherwise;
  } catch {
    return otherwise;
  }
}

export function keep(name, value) {
  try {
    localStorage.setItem(PREFIX + name, JSON.stringify(value));
  } catch {
    // Full or forbidden: the page works without.
  }
}
