// The page: puts what comes into its places, and asks for what is clicked.
// Whatever the bench says goes in as text, never as markup.

import { build, buildLive } from "./forms.js";
import { Link, moment, msSince } from "./link.js";
import { element, setText } from "./style/plots.js";
import { day, time } from "./plot.js";
import { Plots } from "./plots.js";
import { Queue } from "./queue.js";
import { Runs, previewed } from "./runs.js";
import { Tiles } from "./tiles.js";

const $ = (id) => document.getElementById(id);
let plots = null;
let runs = null;
let queue = null;
let status = null;
let modes = {};
let showGains = () => {};
const left = new Set(); // axes that are not to be armed
let toArm = [];
let someArmed = false;
let eventsShown = "";
let stood = ""; // where the preview of a motion begins: of which axis, and after what
const lines = new Map(); // of the arming dialog, by what has to hold

// When what stands here was of now: beside each reading stands its age from then on.
let newest = moment();

const link = new Link({
  hello: begin,
  frame: (frame) => {
    mode(frame.mode);
    if (!plots.take(frame)) link.send({ do: "drawn" });
  },
  marks: ({ marks }) => plots.marks(marks),
  job: ({ job }) => runs?.job(job),
  status: take,
  late: (why) => become("late", "No word from smad view", `${why} STOP may not reach the bench: press it, and use smad disarm or the switch of the bench as well.`),
  lost: (why) => become("lost", "Connection lost", `${why} STOP does not reach the bench from here: use smad disarm, or its switch.`),
});

const tiles = new Tiles($("tiles"), (axis) => link.send({ do: "look_at", axis }));

setInterval(showAge, 1000);

function showAge() {
  document.body.style.setProperty("--age", `" (${(msSince(newest) / 1000).toFixed(0)} s old)"`);
}

// "live", or why what stands here is not to be trusted. STOP is refused to nobody while there is a way
// to the server: the daemon hears stops apart from all else.
function become(state, what = "", why = "", oldS = 0) {
  document.body.dataset.link = state;
  if (state === "live" || oldS > 0) newest = moment(1000 * oldS);
  showAge();
  setText($("lost-what"), what);
  setText($("lost-why"), why);
  $("stop").disabled = state === "lost";
  if ($("commands")) {
    $("commands").disabled = state !== "live";
    if (state !== "live") $("arming").close();
  }
}

function begin(hello) {
  const view = plots?.view;
  plots?.close();
  modes = hello.modes;
  link.axis = hello.axis;
  plots = new Plots(hello, link, view);
  setText($("bench"), hello.axis ? `${hello.bench}: ${hello.axis}` : hello.bench);
  document.title = `${hello.bench} – smad`;
  queue?.end();
  const command = hello.right === "command";
  queue = new Queue({ ask: (message) => link.ask(message), tell, command });
  if (!command) {
    document.querySelectorAll(".command").forEach((node) => node.remove());
    return;
  }
  const channel = plots.data.channels.get("displacement_mm");
  const limit = () => plots.data.limits.displacement_mm;
  moving(hello.trajectories, channel, limit);
  $("tune").replaceChildren();
  showGains = buildLive($("tune"), hello.tuning, tune);
  runs = new Runs({ ask: (message) => link.ask(message), say: ask, channel, limit });
}

function take(message) {
  status = message.status;
  plots.data.limits = message.limits;
  plots.session(message.first_s);
  if (message.away) {
    become("away", "The daemon does not answer", `${message.away}. What stands here is old. STOP may not reach the bench: press it, and use the switch of the bench as well.`, message.silent_s);
  } else if (message.silent_s > 0) {
    become("silent", "No samples come", `Link: ${status.link}. STOP still works; the age of each value stands beside it.`, message.silent_s);
  } else {
    become("live");
  }
  tiles.show(message.tiles, link.axis);
  if (status) show(status, message.armed);
}

// The last names of a path.
function ending(path, names) {
  return path.split("/").slice(-names).join("/");
}

function show(now, anyArmed) {
  document.body.dataset.generation = now.generation;
  mode(now.mode);
  setText($("running"), now.running + (now.limiter ? `, current limited by ${now.limiter}` : ""));
  setText($("holder"), now.holder ? `${now.holder}, ${now.lease_left_s.toFixed(0)} s left` : "anybody");
  const recorder = now.recorder;
  setText($("recording"), recorder.error
    || (recorder.recording ? `${ending(recorder.path, 1)}, ${recorder.rows} samples` : "no"));
  setText($("last-minute"), ending(recorder.last, 2) || "in memory, not saved");
  const age = now.setpoint_age_p99_ms == null ? "" : `, setpoint age ${now.setpoint_age_p99_ms} ms (p99), ${now.counts.setpoints_refused} too old`;
  setText($("link"), `${now.link}, ${now.rate_hz} Hz, ${now.counts.missed} missed${age}`);
  $("trouble").hidden = !now.trouble;
  if (now.trouble) {
    setText($("trouble-what"), now.trouble.what);
    setText($("trouble-cause"), now.trouble.cause);
    setText($("trouble-remedy"), now.trouble.remedy);
  }
  $("warnings").hidden = !now.warnings.length;
  setText($("warnings"), `Warning: ${now.warnings.join(", ")}`);
  tellEvents(now.events);
  if ($("commands")) offer(now, anyArmed);
}

function tellEvents(events) {
  const rows = events.map((event) => [`${day(event.time_s)}${time(event.time_s)}`, ` ${event.text}`]).reverse();
  const text = JSON.stringify(rows);
  if (text === eventsShown) return;
  eventsShown = text;
  $("events").replaceChildren(...rows.map(([when, what]) =>
    element("li", {}, element("time", { textContent: when }), what)));
}

function mode(name) {
  setText($("mode"), name || "–");
  setText($("mode-means"), modes[name] ?? "");
  $("mode").dataset.mode = name;
}

// What can be asked for now, and what stands against arming.
function offer(now, anyArmed) {
  someArmed = anyArmed;
  const axes = now.conditions.map((condition) => condition.axis).filter(Boolean);
  $("arm").disabled = link.axis ? !axes.length : now.armed;
  $("disarm").disabled = !anyArmed;
  $("clear").disabled = !now.trouble;
  $("idle").disabled = !now.armed;
  movable(now.armed);
  // A motion begins where the one before has left the pair: its preview is drawn anew.
  const stands = [link.axis, now.mode, now.running, now.motion_number].join();
  if (stands !== stood) {
    stood = stands;
    $("move").oninput?.();
  }
  showGains(now.gains);
  setText($("record-go"), now.recorder.recording ? "Stop recording" : "Record");
  $("record-name").hidden = now.recorder.recording;
  const shown = now.conditions.map(lineOf);
  if (shown.some((line, k) => line !== $("conditions").children[k]) || shown.length !== $("conditions").children.length) {
    $("conditions").replaceChildren(...shown);
  }
  $("arm-now").disabled = now.conditions.some((condition) => !condition.holds && !left.has(condition.axis))
    || (axes.length > 0 && axes.every((axis) => left.has(axis)));
  toArm = axes.filter((axis) => !left.has(axis));
}

// The line of a condition. It stays the same one, so that its box keeps the focus and a click that has begun.
function lineOf({ text, axis, holds, detail }) {
  if (!lines.has(text)) lines.set(text, element("li", {}, axis ? chosen(axis) : text, element("span")));
  const line = lines.get(text);
  line.className = holds ? "holds" : "fails";
  setText(line.lastChild, detail && ` – ${detail}`);
  return line;
}

// A box to leave an axis out of an arming.
function chosen(axis) {
  const box = element("input", { type: "checkbox", checked: !left.has(axis) });
  box.onchange = () => {
    left[box.checked ? "delete" : "add"](axis);
    // At once: who clicks before the next status must not arm it.
    toArm = box.checked ? [...toArm, axis] : toArm.filter((name) => name !== axis);
    if (!toArm.length) $("arm-now").disabled = true;
  };
  return element("label", {}, box, ` ${axis}`);
}

function movable(armed) {
  document.querySelectorAll("#move button").forEach((button) => {
    button.disabled = !armed;
    button.title = armed ? "" : "Press Arm first";
  });
}

async function ask(message) {
  const reply = await link.ask(message);
  tell(reply);
  return reply.done;
}

function tell(reply) {
  setText($("said"), `${time(Date.now() / 1000)} ${reply.done ? "" : "not done: "}${reply.text}`);
  $("said").classList.toggle("refused", !reply.done);
}

const tune = (field, value) => ask({ do: "tune", tune: { mode: "tune", [field.name]: value } });

function moving(kinds, channel, limit) {
  const chosen = $("kind").value || kinds[0].tag;
  $("kind").replaceChildren(...kinds.map((kind) => element("option", { value: kind.tag, textContent: kind.title })));
  $("kind").value = chosen;
  const fill = () => {
    const kind = kinds.find((form) => form.tag === $("kind").value);
    $("move").replaceChildren(element("p", { className: "small", textContent: kind.about }));
    const read = build($("move"), kind);
    $("move").append(element("div", { className: "row" },
      element("button", { textContent: "Go", value: "go" }),
      element("button", { textContent: "Queue", value: "queue" })));
    movable(Boolean(status?.armed));
    previewed($("move"), $("move-preview"), (message) => link.ask(message),
      () => ({ do: "preview", trajectory: { kind: kind.tag, ...read() } }), channel, limit);
    $("move").onsubmit = (event) => {
      event.preventDefault();
      const queue = event.submitter?.value === "queue";
      ask({ do: "move", trajectory: { kind: kind.tag, ...read() }, queue });
    };
  };
  $("kind").onchange = fill;
  fill();
}

function submitted(id, todo) {
  $(id).onsubmit = (event) => {
    event.preventDefault();
    todo();
  };
}

function stop() {
  tell({ done: true, text: "stopping …" });
  ask({ do: "stop" });
}

$("stop").onclick = $("disarm").onclick = stop;
$("idle").onclick = () => ask({ do: "idle" });
$("clear").onclick = () => status?.trouble && ask({ do: "clear", fault: status.trouble.number });
$("arm").onclick = () => $("arming").show();
$("arm-not").onclick = () => $("arming").close();
$("arm-now").onclick = () => {
  $("arming").close();
  ask({ do: "arm", keep_control: $("keep").checked, axes: toArm });
};
document.addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !event.repeat) {
    const asking = $("arming")?.open;
    $("arming")?.close();
    if (!$("stop").disabled && (someArmed || !asking)) stop();
  }
  if (event.key !== " " || event.target.closest("button, input, select, summary, a")) return;
  event.preventDefault();
  $("pause").click();
});
// The second click of a double click must not queue, mark or begin a thing again.
document.addEventListener("click", (event) => {
  if (event.detail > 1 && event.target.closest("form button")) event.preventDefault();
}, true);
submitted("tune", () => {});
submitted("record", () =>
  ask(status?.recorder.recording ? { do: "end_record" } : { do: "record", name: $("record-name").value }));
submitted("note", async () => {
  const text = $("note-text").value;
  if (!(await ask({ do: "note", text }))) return;
  $("note-text").value = "";
});
