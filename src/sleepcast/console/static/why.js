// Why: how one robot evaluated one command, as the expression with the value of each of its parts.

import { clock } from "./accounting.js";

const HELD = "Every test was true, but STOP held the robot, so it did not move. Send the command again after Release.";
const MARKS = { true: "✓", false: "✗", unknown: "?", skipped: "·", fault: "!" };

// Show one explanation (answer of the question "why") of the command in this row of the account.
export function drawWhy(pane, why, row) {
  const about = Object.assign(document.createElement("p"), { className: "about" });
  about.textContent = `for the command sent at ${clock(row.at)}`;
  const verdict = document.createElement("div");
  verdict.className = `verdict ${why.held ? "held" : why.matched ? "matched" : "not-matched"}`;
  const mark = document.createElement("b");
  mark.textContent = verdictOf(why);
  verdict.append(mark, about);
  const reason = document.createElement("p");
  reason.className = "reason";
  reason.textContent = why.held ? HELD : why.reason || (why.matched ? "Every test was true." : why.faults[0] ?? "");
  const tree = document.createElement("ul");
  tree.className = "tree";
  tree.setAttribute("role", "tree");
  tree.setAttribute("aria-label", "The expression with its values");
  tree.append(branch(why.root, 1));
  const precedence = document.createElement("p");
  precedence.textContent = why.precedence;
  precedence.hidden = !why.precedence;
  const bid = document.createElement("p");
  bid.textContent = why.bid;
  bid.hidden = !why.bid;
  pane.replaceChildren(verdict, reason, bid, precedence, tree);
}

function verdictOf(why) {
  if (why.held) return "■ matched, held by STOP";
  if (why.matched) return "✓ matched";
  if (why.faults.length) return "! fault";
  return culprit(why.root)?.state === "unknown" ? "? test unknown" : "✗ not matched";
}

// The part that says why the test does not hold.
function culprit(step) {
  return step.note ? step : step.parts.map(culprit).find(Boolean);
}

// One part with the parts inside it; numbers that only stand for themselves are left to their parent's text.
function branch(step, level) {
  const item = document.createElement("li");
  item.setAttribute("role", "treeitem");
  item.setAttribute("aria-level", level);
  item.className = `${step.state}${step.note ? " culprit" : ""}`;
  const line = document.createElement("div");
  line.className = "line";
  const mark = document.createElement("span");
  mark.className = "mark";
  mark.textContent = MARKS[step.state] ?? "";
  mark.setAttribute("aria-label", step.state);
  const text = document.createElement("code");
  text.textContent = step.text;
  text.title = step.text;
  const value = document.createElement("span");
  value.className = "value";
  value.textContent = step.state === "skipped" ? "skipped" : step.value;
  line.append(mark, text, value);
  item.append(line);
  if (step.note || step.fault) {
    const note = document.createElement("p");
    note.className = "note";
    note.textContent = step.fault || step.note;
    item.append(note);
  }
  if (step.parts.length && step.state !== "skipped") {
    item.setAttribute("aria-expanded", "true");
    const inside = document.createElement("ul");
    inside.setAttribute("role", "group");
    inside.append(...step.parts.map((part) => branch(part, level + 1)));
    item.append(inside);
  }
  return item;
}
