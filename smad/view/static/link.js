// The WebSocket: messages in, questions out, and what to say when it is gone.

const RETRY_MS = 1000;
const PATIENCE_MS = 5000; // the server speaks twice a second
const GIVEN_UP_MS = 15000; // by then the server has given this page up, too

// A time of now, or so long ago, and how long ago one was. The clock that nobody sets may stand still while
// the computer sleeps, the other one may be set.
export const moment = (agoMs = 0) => [performance.now() - agoMs, Date.now() - agoMs];
export const msSince = ([steady, wall]) => Math.max(performance.now() - steady, Date.now() - wall);

// The key came with the page when its link was opened. The tab keeps it for when it is loaded again:
// no cookie and no address has it, so no other server on this host is ever shown it.
function keyOf() {
  const given = document.querySelector("meta[name=smad-key]");
  if (given.content) sessionStorage.setItem("smad-key", given.content);
  given.remove();
  if (location.search) history.replaceState(null, "", "/");
  return sessionStorage.getItem("smad-key") ?? "";
}

export class Link {
  // `on` has a function for each type of message, `lost(why)`, and `late(why)` while something may still get through.
  constructor(on) {
    this.on = on;
    this.generation = null; // the stops that this page has shown
    this.axis = ""; // the one that it shows
    this.lastId = 0;
    this.waiting = new Map();
    this.key = keyOf();
    if (!this.key) {
      on.lost("This tab was not opened with a link that smad view printed: open that link here.");
      return;
    }
    setInterval(() => this.check(), 500);
    this.open();
  }

  open() {
    // Of the page's own scheme only what comes after its fourth letter: ":" or "s:".
    const address = `ws${location.protocol.slice(4)}//${location.host}/ws`;
    const socket = new WebSocket(address, ["smad", `key.${this.key}`]);
    this.socket = socket;
    this.heard = moment();
    socket.onmessage = (event) => this.take(socket, event.data);
    socket.onclose = (event) => this.closed(socket, event.reason);
  }

  take(socket, text) {
    if (socket !== this.socket) return;
    this.heard = moment();
    const message = JSON.parse(text);
    if (message.type === "status") {
      if (message.status) this.generation = message.status.generation;
      this.send({ do: "alive" });
    }
    if (message.type === "reply") this.answered(message);
    else this.on[message.type](message);
  }

  answered(reply) {
    const tell = this.waiting.get(reply.id);
    this.waiting.delete(reply.id);
    if (tell) tell(reply);
  }

  closed(socket, reason) {
    if (socket !== this.socket) return;
    this.socket = null;
    for (const tell of this.waiting.values()) {
      tell({ done: false, text: "the connection was lost before an answer came" });
    }
    this.waiting.clear();
    this.on.lost(reason || "The connection to smad view is gone. If it was started again, open its new link.");
    setTimeout(() => this.open(), RETRY_MS);
  }

  check() {
    const { socket } = this;
    if (!socket || msSince(this.heard) < PATIENCE_MS) return;
    const why = "smad view has not said anything for five seconds.";
    if (msSince(this.heard) < GIVEN_UP_MS) {
      this.on.late(why);
      return;
    }
    // Whatever lies between may never say that it is gone: a network that was left, a computer that slept.
    this.closed(socket, why);
    socket.close();
  }

  // Send what needs no answer; returns its number.
  tell(message) {
    this.lastId += 1;
    this.send({ ...message, id: this.lastId });
    return this.lastId;
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  // Ask for something; resolves to { done, text, found }.
  ask(message) {
    this.lastId += 1;
    const id = this.lastId;
    if (this.socket?.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ done: false, text: "not sent: there is no connection" });
    }
    return new Promise((resolve) => {
      this.waiting.set(id, resolve);
      this.send({ ...message, id, generation: this.generation, axis: this.axis });
    });
  }
}
