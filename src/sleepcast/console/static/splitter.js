// A splitter: a bar between two panes that is dragged, or moved by the arrow keys, to give one of them more room.

import { kept, keep } from "./kept.js";

const STEP = 24; // pixels that an arrow key moves it

// bar: the element. vertical: whether it moves up and down. read(): the size of its pane in pixels. apply(size): sets it,
// within what fits. The size is remembered under `name`.
export function splitter(bar, { name, vertical, read, apply }) {
  const grows = -1; // the pane lies to the right of the bar, or below it
  const set = (size) => {
    apply(size);
    const now = Math.round(read());
    bar.setAttribute("aria-valuenow", String(now));
    keep(name, now);
  };
  let from = null; // {at, size} while it is dragged
  bar.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    bar.setPointerCapture(event.pointerId);
    from = { at: vertical ? event.clientY : event.clientX, size: read() };
    event.preventDefault();
  });
  bar.addEventListener("pointermove", (event) => {
    if (from) set(from.size + grows * ((vertical ? event.clientY : event.clientX) - from.at));
  });
  for (const end of ["pointerup", "pointercancel"]) bar.addEventListener(end, () => (from = null));
  bar.addEventListener("keydown", (event) => {
    const arrows = vertical ? { ArrowUp: 1, ArrowDown: -1 } : { ArrowLeft: 1, ArrowRight: -1 };
    const step = arrows[event.key];
    if (!step) return;
    event.preventDefault();
    set(read() + step * STEP);
  });
  const before = kept(name, null);
  if (typeof before === "number" && before > 0) apply(before);
}
