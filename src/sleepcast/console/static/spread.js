// The histogram below a number: how the values of what it is compared with lie over the robots, and the number in it.

const WIDTH = 264; // CSS pixels of the picture
const HEIGHT = 34;

// box: holds a canvas, .low, .high and .what. spread: the desk's answer. number, text: the threshold, and as written.
export function drawSpread(box, spread, number, text) {
  const canvas = box.querySelector("canvas");
  const ratio = Math.min(2, window.devicePixelRatio || 1);
  if (canvas.width !== WIDTH * ratio) {
    canvas.width = WIDTH * ratio;
    canvas.height = HEIGHT * ratio;
    canvas.style.width = `${WIDTH}px`;
    canvas.style.height = `${HEIGHT}px`;
  }
  const style = getComputedStyle(box);
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, WIDTH, HEIGHT);
  const most = Math.max(1, ...spread.every);
  const step = WIDTH / spread.every.length;
  const column = (count, at, colour) => {
    if (!count) return;
    const height = Math.max(1, (count / most) * (HEIGHT - 2)); // one robot is seen beside a thousand
    pen.fillStyle = style.getPropertyValue(colour);
    pen.fillRect(at * step, HEIGHT - height, Math.max(1, step - 1), height);
  };
  spread.every.forEach((count, at) => column(count, at, "--spread-all"));
  spread.deciding.forEach((count, at) => column(count, at, "--accent"));
  const place = (Number(number) - spread.low) / (spread.high - spread.low);
  const x = Math.min(WIDTH - 1, Math.max(1, place * WIDTH));
  pen.strokeStyle = pen.fillStyle = style.getPropertyValue("--ink");
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(x, 0);
  pen.lineTo(x, HEIGHT);
  pen.stroke();
  pen.beginPath(); // a mark at its top, which points outside where the number lies there
  const aside = place < 0 ? -5 : place > 1 ? 5 : 0;
  pen.moveTo(x - 4 + aside, 0);
  pen.lineTo(x + 4 + aside, 0);
  pen.lineTo(x, 6);
  pen.fill();
  const total = spread.deciding.reduce((sum, count) => sum + count, 0);
  const shown = (value) => `${+value.toPrecision(3)}${spread.unit}`;
  const [low, high] = spread.whole ? [Math.ceil(spread.low), Math.floor(spread.high)] : [spread.low, spread.high];
  box.querySelector(".low").textContent = shown(low);
  box.querySelector(".high").textContent = shown(high);
  box.querySelector(".what").textContent = `${spread.quantity}: decides for ${total.toLocaleString("en")}`;
  canvas.setAttribute("aria-label", `${spread.quantity} of all robots, from ${shown(low)} to ${shown(high)}; the number is ${text}`);
  box.title = "Blue: the robots for whom this number decides. Grey: all others. Drag the number, or press Alt+↑ and Alt+↓ (with Shift ten times as far).";
}
