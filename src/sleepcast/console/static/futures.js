// Two futures in one plot: that of this run, and the one that it has left.

import { clock } from "./accounting.js";

export const EARLIER = "earlier future";

// Where this run has left another one, as the desk tells it of the timeline: {at, label, text}, or null. The first
// difference is named once it is known.
export function partingOf({ forked, differs, difference }) {
  if (forked === null) return null;
  if (differs !== null) return { at: differs, label: "first difference", text: `first difference at ${difference}` };
  return { at: forked, label: "went on from here", text: difference || `went on from ${clock(forked)}: no difference yet` };
}

// Columns of this run and of the earlier future as one table. Where only one has a number, the other has undefined.
export function alongside(data, earlier) {
  return earlier.length ? uPlot.join([data, earlier]) : data;
}

// The latest number of a column at a place or before it.
export function atOrBefore(column, at) {
  let place = at;
  while (place > 0 && column[place] === undefined) place -= 1;
  return column[place] ?? null;
}
