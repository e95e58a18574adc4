// What the prompt must know of the language to help while one types: tokens, parentheses, the word at the caret.
// Whether a text is right is not decided here but by the station's own checker.

const TOKEN = /;[^\n]*|"[^"\n]*"?|[()'`,]|[^\s()'`,;"]+/g;
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?(%|[a-z]+(\/[a-z]+)?\d?)?$/i;

// Tokens of a text: {kind, text, start, end}; kinds: comment label open close mark number name head.
// A head is the name after an opening parenthesis: what is called.
export function tokens(text) {
  const tokens = [];
  let previous = null;
  for (const match of text.matchAll(TOKEN)) {
    const piece = match[0];
    const token = { kind: kindOf(piece, previous), text: piece, start: match.index, end: match.index + piece.length };
    tokens.push(token);
    if (token.kind !== "comment") previous = token;
  }
  return tokens;
}

function kindOf(piece, previous) {
  if (piece[0] === ";") return "comment";
  if (piece[0] === '"') return "label";
  if (piece === "(") return "open";
  if (piece === ")") return "close";
  if (piece.length === 1 && "'`,".includes(piece)) return "mark";
  if (NUMBER.test(piece)) return "number";
  return previous?.kind === "open" ? "head" : "name";
}

// Offset of each parenthesis to the offset of its partner; -1 where there is none.
export function partners(tokens) {
  const pairs = new Map();
  const open = [];
  for (const token of tokens) {
    if (token.kind === "open") {
      open.push(token.start);
      pairs.set(token.start, -1);
    } else if (token.kind === "close") {
      const start = open.pop();
      pairs.set(token.start, start ?? -1);
      if (start !== undefined) pairs.set(start, token.start);
    }
  }
  return pairs;
}

// Whether the text only lacks closing parentheses: nothing is wrong with it yet.
export function isUnfinished(tokens) {
  let depth = 0;
  for (const token of tokens) {
    if (token.kind === "open") depth += 1;
    if (token.kind === "close") depth -= 1;
    if (depth < 0) return false;
  }
  return depth > 0;
}

// The name that ends at the caret, as {text, start, end}, or null; end reaches to the end of the word.
export function wordAt(tokens, caret) {
  const token = tokens.find((each) => each.start < caret && caret <= each.end);
  return token && (token.kind === "name" || token.kind === "head") ? token : null;
}

// The function whose call surrounds the caret, or null.
export function callAt(tokens, caret) {
  const open = [];
  for (let i = 0; i < tokens.length && tokens[i].start < caret; i += 1) {
    if (tokens[i].kind === "open") open.push(tokens[i + 1]?.kind === "head" ? tokens[i + 1].text : null);
    if (tokens[i].kind === "close") open.pop();
  }
  return open.pop() ?? null;
}
