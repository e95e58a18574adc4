// Elements of the page, made and written.

// An element with these properties and contents.
export function make(tag, properties = {}, ...contents) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...contents);
  return element;
}

// A part of a pane with its heading.
export function section(title, ...contents) {
  return make("section", {}, make("h2", {}, title), ...contents);
}

// A field with the text before it.
export function label(text, field) {
  return make("label", {}, `${text} `, field);
}

// Put a text there, if it is not there already: a screen reader would say it again.
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
