// The connection to the station: one WebSocket, JSON both ways, binary frames downwards (console/frames.py).
//
// Every question carries a serial number and gets a promise for its answer. A frame is answered for once it
// has been drawn, and only then is the next one sent: a slow page skips frames and never queues them. A cable that
// was cut closes no connection, so the station says every two seconds at least that it is there. In a notebook, a `Port`
// stands for the WebSocket.

const FIRST_WAIT = 500; // ms before the first attempt to connect again; doubles up to LONGEST_WAIT
const LONGEST_WAIT = 8000;
const ANSWER_WAIT = 15000; // ms after which a question counts as unanswered
const SILENCE = 6000; // ms without a word after which the station may not be there
const ALTERNATE = 255; // the first byte of where robots were in another future
const LOOK = 1000; // ms between two looks for that

export class Refusal extends Error {
  // count: whether it would be obeyed if it came with the number of robots that are meant; doubt: if it came confirmed
  constructor(reason, count = false, doubt = false) {
    super(reason);
    this.count = count;
    this.doubt = doubt;
  }
}

export class Wire extends EventTarget {
  // open: makes a new WebSocket. beats: whether the station speaks every two seconds.
  constructor(open, beats = true) {
    super();
    this.make = open;
    this.waiting = new Map();
    this.serial = 0;
    this.wait = FIRST_WAIT;
    this.connect();
    if (beats) setInterval(() => this.look(), LOOK);
  }

  get open() {
    return this.socket.readyState === WebSocket.OPEN;
  }

  connect() {
    this.socket = this.make();
    this.socket.binaryType = "arraybuffer";
    this.silent = false;
    this.socket.onopen = () => {
      this.heardAt = performance.now();
      this.wait = FIRST_WAIT;
    };
    this.socket.onmessage = (event) => this.receive(event.data);
    this.socket.onclose = (event) => this.lost(event);
  }

  lost(event) {
    for (const { reject, timer } of this.waiting.values()) {
      clearTimeout(timer);
      reject(new Refusal("The connection to the station was lost before an answer came."));
    }
    this.waiting.clear();
    this.emit("lost", { reason: event.reason, again: this.wait });
    setTimeout(() => this.connect(), this.wait);
    this.wait = Math.min(this.wait * 2, LONGEST_WAIT);
  }

  look() {
    if (!this.open || this.silent || performance.now() - this.heardAt < SILENCE) return;
    this.silent = true;
    this.emit("silent");
  }

  receive(data) {
    this.heardAt = performance.now();
    if (this.silent) {
      this.silent = false;
      this.emit("heard");
    }
    if (data instanceof ArrayBuffer) {
      this.emit(new Uint8Array(data, 0, 1)[0] === ALTERNATE ? "alternate" : "frame", data);
      return;
    }
    const message = JSON.parse(data);
    const asked = this.waiting.get(message.serial);
    if (!asked) {
      this.emit(message.type, message);
      return;
    }
    this.waiting.delete(message.serial);
    clearTimeout(asked.timer);
    if (message.type === "refused") asked.reject(new Refusal(message.reason, message.count, message.doubt));
    else asked.resolve(message);
  }

  // Send a message that wants no answer; false if there is no connection.
  tell(type, fields = {}) {
    if (!this.open) return false;
    this.socket.send(JSON.stringify({ type, ...fields }));
    return true;
  }

  // Send a question; a promise for the answer, which a refusal breaks with its reason. patience: ms, Infinity for
  // what may take as long as it likes.
  ask(type, fields = {}, patience = ANSWER_WAIT) {
    return new Promise((resolve, reject) => {
      const serial = ++this.serial;
      if (!this.tell(type, { serial, ...fields })) {
        reject(new Refusal("There is no connection to the station."));
        return;
      }
      const late = () => {
        this.waiting.delete(serial);
        reject(new Refusal("The station has not answered."));
      };
      const timer = patience < Infinity ? setTimeout(late, patience) : 0;
      this.waiting.set(serial, { resolve, reject, timer });
    });
  }

  emit(name, detail) {
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
