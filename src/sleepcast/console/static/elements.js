// Elements of the page, made and written.

// An element with these properties and contents.
export function make(tag, properties = {}, ...contents) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...contents);
  return element;
}

// Put a text there, if it is not there already: a screen reader would say it again.
export function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}
