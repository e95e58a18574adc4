// Text on canvases: it grows with the window as the page's own does.

const BASE = 14; // pixels of the page's type on the smallest window, for which sizes on canvases are written

let times = 1; // by which type is larger now
const measure = () => (times = Number.parseFloat(getComputedStyle(document.documentElement).fontSize) / BASE);
window.addEventListener("resize", measure);
measure();

// So many pixels of the smallest window's, as they are now.
export const grown = (pixels) => pixels * times;

// A font of this size. weight: as in CSS.
export const font = (pixels, weight = 400) => `${weight} ${grown(pixels)}px system-ui, sans-serif`;
