// How fine a picture is that software draws: it pays for each pixel, so where pictures take it long, they are coarser while
// something moves, and sharp again as soon as nothing does.

const SLOW = 25; // ms that the page is busy with a picture in the mean, beyond which pictures are coarse;
const FAST = 18; // below this they are fine again
const LONGEST = 60; // ms that one picture counts at most: the first ones have to be prepared
const SHARE = 0.1; // of the latest picture in the mean
const COARSE = 0.7; // of the pixels of each side
const REST = 400; // ms without a picture until the last one is to be drawn sharp

export class Fineness {
  // again: called when the last picture was coarse, and nothing has moved since.
  constructor(again) {
    this.again = again;
    this.busy = 0; // ms, in the mean
    this.coarse = false;
    this.timer = 0;
  }

  // The part of each side's pixels that the picture has which is drawn now. moves: whether it shows anything that has moved.
  next(moves) {
    clearTimeout(this.timer);
    if (!moves) return 1;
    const begun = performance.now();
    setTimeout(() => this.took(performance.now() - begun)); // after the picture, which the page waits for
    if (!this.coarse) return 1;
    this.timer = setTimeout(this.again, REST);
    return COARSE;
  }

  // The page was busy so long with a picture, ms.
  took(time) {
    this.busy += SHARE * (Math.min(LONGEST, time) - this.busy);
    this.coarse = this.busy > (this.coarse ? FAST : SLOW);
  }
}
