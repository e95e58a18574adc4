// What is served instead of the page to whoever does not show the token. A page that is loaded again has it not in its
// address any more (token.js), but in this browser.

const NAME = "sleepcast.token";
const shown = new URLSearchParams(window.location.search).has("token");
let kept = null;

try {
  kept = localStorage.getItem(NAME);
  if (shown) localStorage.removeItem(NAME); // that of an earlier start
} catch {
  // a browser that keeps nothing
}

if (kept && !shown) window.location.replace(`/?token=${encodeURIComponent(kept)}${window.location.hash}`);
else for (const each of document.querySelectorAll("[hidden]")) each.hidden = false;
