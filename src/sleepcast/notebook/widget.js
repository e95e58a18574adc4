// The widget: the page in a frame of its own, so that neither the notebook's keys and styles nor the page's reach the
// other, and its messages to and from the kernel.
//
// From the kernel come {say} with a text of the page's wire, and {wait, answer} with the bytes of a picture: wait, in
// ms, before the next one may be asked for; answer, whether this one was asked for. To it go {open} for each page that
// has begun, {close} for each that has gone, and {say}. While time runs by itself, the page asks for the next picture
// when it has drawn one, and one at a time, however long a cell keeps the kernel busy.

const LOOK = 1000; // ms between two looks whether an answer is missing
const PATIENCE = 5000; // ms after which the next picture is asked for once more: a server drops what is too much for it

// "dark" where the notebook's text is light. The browser itself says which colour stands behind any CSS notation.
function themeAround(element) {
  const pen = Object.assign(document.createElement("canvas"), { width: 1, height: 1 }).getContext("2d");
  pen.fillStyle = getComputedStyle(element).color;
  pen.fillRect(0, 0, 1, 1);
  const [red, green, blue] = pen.getImageData(0, 0, 1, 1).data;
  return 0.3 * red + 0.6 * green + 0.1 * blue > 128 ? "dark" : "light";
}

function render({ model, el }) {
  let port = null;
  let running = false; // whether time runs by itself, as the latest picture says
  let due = 0; // when the next picture may be asked for
  let asked = null; // the question for it that has no answer yet: {text, at}

  const frame = document.createElement("iframe");
  frame.title = "Map and prompt of the fleet";
  frame.sandbox = "allow-scripts allow-forms";
  frame.srcdoc = model.get("page");
  frame.style.cssText = `display: block; box-sizing: border-box; width: 100%; height: ${model.get("height")}px; border: 1px solid #8886; border-radius: 8px`;
  frame.addEventListener("load", begin);
  el.append(frame);

  function begin() {
    const channel = new MessageChannel();
    port = channel.port1;
    port.onmessage = ({ data }) => fromPage(data);
    asked = null;
    frame.contentWindow.postMessage({ theme: themeAround(el) }, "*", [channel.port2]);
    model.send({ open: true });
  }

  function fromPage(text) {
    if (JSON.parse(text).type !== "drawn") model.send({ say: text });
    else if (running && !asked) {
      asked = { text, at: Infinity };
      setTimeout(ask, Math.max(0, due - performance.now()));
    }
  }

  function ask() {
    if (!asked) return;
    asked.at = performance.now();
    model.send({ say: asked.text });
  }

  function fromKernel(content, buffers) {
    if (!port) return;
    if (content.say !== undefined) {
      port.postMessage(content.say);
      return;
    }
    const [view] = buffers;
    const bytes = new Uint8Array(view.buffer ?? view, view.byteOffset ?? 0, view.byteLength).slice();
    running = (bytes[1] & 1) !== 0; // see console/frames.py
    due = performance.now() + content.wait;
    if (content.answer || !running) asked = null;
    port.postMessage(bytes.buffer, [bytes.buffer]);
  }

  const missed = setInterval(() => {
    if (asked && performance.now() - asked.at > PATIENCE) ask();
  }, LOOK);
  const dressed = new MutationObserver(() => frame.contentWindow?.postMessage({ theme: themeAround(el) }, "*"));
  for (const each of [document.documentElement, document.body]) dressed.observe(each, { attributes: true });
  model.on("msg:custom", fromKernel);

  return () => {
    model.off("msg:custom", fromKernel);
    dressed.disconnect();
    clearInterval(missed);
    if (port) model.send({ close: true });
  };
}

export default { render };
