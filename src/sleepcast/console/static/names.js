// Names that fit what is being typed, from those that the station has told.

// word: a token as of lisp.js. The names that contain it, those that begin with it first; null if it is one of them already.
export function fitting(names, word, most) {
  const key = word.text.toLowerCase();
  if (names.some(({ name }) => name.toLowerCase() === key)) return null;
  const late = ({ name }) => (name.toLowerCase().startsWith(key) ? 0 : 1);
  return names
    .filter(({ name, usage }) => (usage !== "") === (word.kind === "head") && name.toLowerCase().includes(key))
    .sort((a, b) => late(a) - late(b) || a.name.localeCompare(b.name))
    .slice(0, most);
}

// A name as a line of a list.
export function choice({ name, kind, usage, range, doc }) {
  return { value: name, parts: [["name", name], ["kind", kind], ["range", usage || range], ["doc", doc]] };
}
