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

// Hide it, or show it, if it is not so already: the browser would look up styles and put the page together again.
export function hide(element, on) {
  if (element.hidden !== on) element.hidden = on;
}

// The width and height of a pane that canvases cover, in CSS pixels that end where a pixel of the screen does. ratio: pixels
// of the screen for one of these. Software takes three times as long to show a canvas that is a bit wider or narrower than
// its picture.
export function wholePixels(pane, ratio) {
  const { width, height } = pane.getBoundingClientRect();
  return [width, height].map((side) => Math.round(side * ratio) / ratio);
}

// Show a canvas in this size, in CSS pixels.
export function showAs(canvas, width, height) {
  Object.assign(canvas.style, { width: `${width}px`, height: `${height}px` });
}
