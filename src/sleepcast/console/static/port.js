// What stands for the page's WebSocket in a notebook: a port that the notebook's widget hands in, and which it serves by
// messages to the kernel (notebook/widget.js).

export class Port {
  constructor() {
    this.readyState = WebSocket.CONNECTING;
    window.addEventListener("message", ({ source, ports }) => {
      if (source === window.parent && ports.length) this.begin(ports[0]);
    });
  }

  begin(port) {
    this.port = port;
    this.readyState = WebSocket.OPEN;
    this.onopen();
    port.onmessage = (event) => this.onmessage(event);
  }

  send(text) {
    this.port.postMessage(text);
  }
}
