// The banner of a page that does not hear who it speaks with: what it shows may be old, and STOP may not arrive.

const ANEW = "If sleepcast was restarted, open the address that it printed.";

// other: what the page calls it, "the station".
export function showLine(wire, banner, other) {
  const say = (text) => {
    banner.textContent = text;
    banner.hidden = !text;
  };
  wire.addEventListener("hello", () => say(""));
  wire.addEventListener("heard", () => say(""));
  wire.addEventListener("silent", () => {
    say(`No data from ${other} for several seconds. This data may be stale, and STOP may not arrive.`);
  });
  wire.addEventListener("lost", ({ detail }) => {
    const why = detail.reason ? ` (${detail.reason})` : "";
    say(`No connection to ${other}${why}. This data is stale. Reconnecting … ${ANEW}`);
  });
}
