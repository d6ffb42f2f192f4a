// The queue: a table, a form to add, and arming in two steps. All of it is asked of the server.

import { button, day, time } from "./plot.js";
import { element, setText } from "./style/plots.js";

const $ = (id) => document.getElementById(id);
const EVERY_MS = 2000;
const CONFIRM_MS = 120000;
const WHAT = { run: "experiment", tune: "displacement or temperature", checkup: "folder of a baseline", move: "file of trajectories" };

export class Queue {
  // `ask` asks, `tell` shows an answer; a page that only watches does not `command`.
  constructor({ ask, tell, command }) {
    Object.assign(this, { ask, tell, command });
    $("queue").ontoggle = () => this.show();
    this.timer = setInterval(() => this.show(), EVERY_MS);
    this.show();
    if (!command) return;
    $("queue-kind").onchange = () => { $("queue-what").placeholder = WHAT[$("queue-kind").value]; };
    $("queue-kind").onchange();
    $("queue-add").onsubmit = (event) => {
      event.preventDefault();
      this.change({ verb: "add", kind: $("queue-kind").value, what: $("queue-what").value,
        repeat: Number($("queue-repeat").value) });
    };
    $("queue-arm").onsubmit = (event) => {
      event.preventDefault();
      this.propose(Number($("queue-hours").value));
    };
    $("queue-pause").onclick = () => this.change({ verb: "pause" });
    $("queue-pause-now").onclick = () => this.change({ verb: "pause", now: true });
  }

  end() {
    clearInterval(this.timer);
    clearTimeout(this.ending);
    if (this.command) $("queue-confirm").hidden = true;
  }

  async change(change) {
    const reply = await this.ask({ do: "change_queue", change });
    this.tell(reply);
    this.show();
    return reply;
  }

  // The second step is a button that names what it will run, and goes after two minutes.
  async propose(hours) {
    const confirm = $("queue-confirm");
    confirm.hidden = true;
    clearTimeout(this.ending);
    const reply = await this.change({ verb: "propose", hours });
    if (!reply.done) return;
    setText(confirm, `Arm now: ${reply.text}`);
    confirm.hidden = false;
    confirm.onclick = () => {
      confirm.hidden = true;
      this.change({ verb: "confirm", code: reply.found });
    };
    this.ending = setTimeout(() => (confirm.hidden = true), CONFIRM_MS);
  }

  async show() {
    // A server that is busy with another question gets no pile of these behind it.
    if (!$("queue").open || this.asking) return;
    this.asking = true;
    const reply = await this.ask({ do: "queue" });
    this.asking = false;
    if (!reply.done) return setText($("queue-state"), reply.text);
    const queue = reply.found;
    const until = queue.end_unix_s && `${day(queue.end_unix_s)}${time(queue.end_unix_s)}`;
    setText($("queue-state"), (queue.mode === "running" ? `running until ${until}` : `paused: ${queue.reason}`)
      + (queue.runner ? "" : "; no runner is running: start one with smad queue run"));
    const text = JSON.stringify(queue.lines);
    if (text === this.drawn) return;
    this.drawn = text;
    $("queue-list").replaceChildren(...queue.lines.map((line) => this.row(line)));
  }

  row(line) {
    const change = (verb, more = {}) => () => this.change({ verb, item: line.item, ...more });
    const buttons = !this.command ? [] : line.place
      ? [button("↑", "Earlier", change("place", { place: Math.max(1, line.place - 1) })),
        button("↓", "Later", change("place", { place: line.place + 1 })),
        button("Remove", "Remove it", change("remove"))]
      : line.state === "running" ? [] : [button("Again", "Add it again", change("again"))];
    const row = element("tr", {},
      element("td", { textContent: line.item }),
      element("th", { scope: "row", textContent: line.title }),
      element("td", { textContent: line.state }),
      element("td", { textContent: line.why }),
      element("td", {}, element("div", { className: "row" }, ...buttons)));
    row.dataset.item = line.item;
    row.dataset.state = line.state;
    return row;
  }
}
