// How fine a picture is that software draws: it pays for each pixel, so where pictures take it long, they are coarser while
// something moves, and sharp again as soon as nothing does.

const SLOW = 25; // ms that a picture takes in the mean, beyond which pictures are coarse;
const FAST = 12; // below this they are fine again: fine ones take twice as long at most
const LONGEST = 60; // ms that one picture counts at most: the first ones have to be prepared
const SHARE = 0.1; // of the latest picture in the mean
const COARSE = 0.7; // of the pixels of each side
const REST = 400; // ms without a picture until the last one is to be drawn sharp

export class Fineness {
  // again: called when the last picture was coarse, and nothing has moved since.
  constructor(again) {
    this.again = again;
    this.mean = 0; // ms, in the mean
    this.coarse = false;
    this.timer = 0;
  }

  // The part of each side's pixels that the picture has which is drawn now. moves: whether it shows anything that has moved.
  next(moves) {
    clearTimeout(this.timer);
    if (!moves || !this.coarse) return 1;
    this.timer = setTimeout(this.again, REST);
    return COARSE;
  }

  // A picture took so long to draw, ms.
  took(time) {
    this.mean += SHARE * (Math.min(LONGEST, time) - this.mean);
    this.coarse = this.mean > (this.coarse ? FAST : SLOW);
  }
}
