// The page's end of the thread that draws the view in three dimensions (painter.js).

// Pictures under way at most: one that is drawn, and one for which the thread has all it needs, so that it never waits for
// the page. Of what is asked for meanwhile the latest counts.
const UNDER_WAY = 2;

const isPicture = (given) => given instanceof ImageBitmap;

export class Painting {
  // canvas: shows the pictures. shown: called with each: what it was asked for with, and how long it took to draw, ms. ended:
  // called when there will be no more, with the reason in words, "" if another one may go on, and whether pictures could be drawn
  // before. Throws where the browser has no such threads.
  constructor(canvas, shown, ended) {
    this.pen = canvas.getContext("bitmaprenderer", { alpha: false });
    this.shown = shown;
    this.ended = ended;
    this.software = null; // whether no graphics card draws, once the thread has said it
    this.calls = new Map(); // of `Solids`, by name: with what arguments, and what else belongs to the picture
    this.underWay = []; // what each picture was asked for with
    this.taken = []; // to be called when the next one is under way
    this.worker = new Worker(new URL("./painter.js", import.meta.url), { type: "module" });
    this.worker.onmessage = ({ data }) => this.hear(data);
    this.worker.onerror = ({ message }) => this.end(message || "the browser does not start a thread for it");
  }

  // Let a method of `Solids` be called before the next picture is drawn.
  tell(name, ...given) {
    for (const one of this.calls.get(name)?.filter(isPicture) ?? []) one.close(); // which nobody will see
    this.calls.delete(name); // calls stay in the order in which they were told
    this.calls.set(name, given);
  }

  // Have a picture drawn by `Solids.render`. asked: what it shows, for `shown`. Gives a promise that is kept once it is under way.
  ask(asked, ...given) {
    this.tell("render", ...given);
    this.asked = asked;
    const taken = new Promise((done) => this.taken.push(done));
    this.send();
    return taken;
  }

  send() {
    if (this.underWay.length === UNDER_WAY || !this.calls.has("render")) return;
    this.underWay.push(this.asked);
    const calls = [...this.calls];
    this.worker.postMessage(calls, calls.flatMap(([, given]) => given.filter(isPicture)));
    this.calls.clear();
    this.release();
  }

  release() {
    for (const done of this.taken.splice(0)) done();
  }

  // What the thread says: once whether software draws, or why nothing does; then with each picture how long it took, until the
  // browser has taken its graphics away.
  hear({ software, failure, picture, took, lost }) {
    if (lost || failure) this.end(failure ?? "");
    else if (picture) {
      this.pen.transferFromImageBitmap(picture);
      this.shown(this.underWay.shift(), took);
      this.send();
    } else this.software = software;
  }

  end(reason) {
    this.worker.terminate();
    this.release(); // nobody is to wait for pictures that never come
    this.ended(reason, this.software !== null);
  }
}
