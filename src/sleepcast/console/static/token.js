// The session's token, which the printed address carries and the socket asks for. It leaves the address as soon as the
// page is open, so that nobody reads it over a shoulder, in a picture of the screen, or in an address that is passed on.
// This browser keeps it for this server, so that the page can be loaded again (enter.js).

const NAME = "sleepcast.token";

export const token = new URLSearchParams(window.location.search).get("token") ?? "";

try {
  if (token) {
    localStorage.setItem(NAME, token);
    window.history.replaceState(null, "", window.location.pathname + window.location.hash);
  }
} catch {
  // a browser that keeps nothing needs it in the address to load the page again
}

// An address of this server with the token, and what else it is to say.
export function admitted(path, more = {}) {
  const url = new URL(path, window.location.href);
  url.search = new URLSearchParams({ token, ...more });
  url.hash = "";
  return url;
}

// That of the socket.
export function socket() {
  const url = admitted("live");
  url.protocol = url.protocol.replace("http", "ws");
  return url;
}
