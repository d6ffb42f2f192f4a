// The last runs, the one job, and the experiments. All of it is asked of the page's server.

import { build } from "./forms.js";
import { button } from "./plot.js";
import { drawPreviews } from "./preview.js";
import { element, setText } from "./style/plots.js";

const $ = (id) => document.getElementById(id);
const PREVIEW_MS = 250;
const SHORTEST_S = 8; // as smad.diagnosis.plant.Traits has it
const MOST_COMPARED = 6; // as smad.view.jobs.PageOfRun has it

// Ask for a drawing of what a form says, a moment after its last change.
export function previewed(form, host, ask, read, channel, limit) {
  let [waiting, latest] = [0, 0];
  const draw = async () => {
    latest += 1;
    const mine = latest;
    // Of a form that is not filled in there is nothing to draw, and an earlier drawing is no longer of it.
    if (!form.checkValidity()) return drawPreviews(host, [], channel, limit());
    const reply = await ask(read());
    const failed = [{ title: "", words: reply.text, refused: true, t_s: [], mm: [] }];
    if (mine === latest && host.isConnected) drawPreviews(host, reply.done ? reply.found : failed, channel, limit());
  };
  const soon = () => {
    clearTimeout(waiting);
    waiting = setTimeout(draw, PREVIEW_MS);
  };
  form.oninput = soon;
  soon();
}

export class Runs {
  // `say` asks and shows the answer; `ask` only asks.
  constructor({ ask, say, channel, limit }) {
    Object.assign(this, { ask, say, channel, limit });
    this.ticked = new Set();
    this.wasRunning = false;
    $("runs").ontoggle = () => $("runs").open && this.list();
    $("experiments").ontoggle = () => $("experiments").open && this.experiments();
    $("job-end").onclick = () => say({ do: "end_job" });
    $("check-up").onsubmit = (event) => {
      event.preventDefault();
      this.begin({ kind: "checkup", baseline: $("baseline").value, quick: $("quick").checked });
    };
    $("compare").onclick = () => this.begin({ kind: "page", runs: [...this.ticked] });
    if ($("runs").open) this.list();
  }

  begin(job) {
    return this.say({ do: "begin", job });
  }

  async list() {
    const reply = await this.ask({ do: "runs" });
    if (!reply.done) return setText($("runs-none"), reply.text);
    setText($("runs-none"), reply.found.length ? "" : "No run has been recorded yet.");
    const runs = reply.found.map((run) => ({ ...run, name: run.path.split("/").pop() }));
    const names = new Set(runs.map((run) => run.name));
    this.ticked = new Set([...this.ticked].filter((name) => names.has(name)));
    $("runs-list").replaceChildren(...runs.flatMap((run) => this.row(run)));
    this.tick();
  }

  row(run) {
    const results = element("td", { colSpan: 5 });
    const below = element("tr", { hidden: true }, results);
    const box = element("input", { type: "checkbox", checked: this.ticked.has(run.name), ariaLabel: `Tick ${run.name}` });
    box.onchange = () => {
      this.ticked[box.checked ? "add" : "delete"](run.name);
      this.tick();
    };
    const diagnose = button("Diagnose", "Where model and run disagree; with one other run ticked: what changed since that one",
      () => this.begin(this.diagnosis(run.name)));
    // A log of a recorder that was cut notes no duration; the diagnosis looks at it itself.
    if (run.duration_s != null && run.duration_s < SHORTEST_S) {
      diagnose.disabled = true;
      diagnose.title = `A run of less than ${SHORTEST_S} s cannot be diagnosed`;
    }
    const cells = [
      element("td", {}, box),
      element("th", { scope: "row", textContent: run.name.replace(/\.mcap$/, "") }),
      element("td", { textContent: run.duration_s == null ? run.problem : `${run.duration_s.toFixed(1)} s` }),
      element("td", { textContent: run.rows == null ? "" : `${run.rows} samples` }),
      element("td", {}, element("div", { className: "row" },
        button("Results", "What this run came to", () => this.results(run, below, results)),
        button("Page", "The page of this run", () => this.begin({ kind: "page", runs: [run.name] })),
        diagnose)),
    ];
    const row = element("tr", {}, ...cells);
    row.dataset.run = run.name;
    return [row, below];
  }

  diagnosis(run) {
    const others = [...this.ticked].filter((name) => name !== run);
    return { kind: "diagnose", run, ...(others.length === 1 ? { good: others[0] } : {}) };
  }

  tick() {
    const { size } = this.ticked;
    $("compare").disabled = size < 2 || size > MOST_COMPARED;
    setText($("compare"), size > MOST_COMPARED ? `Compare ${MOST_COMPARED} runs at most` : `Compare ${size > 1 ? `${size} runs` : "ticked runs"}`);
  }

  async results(run, below, cell) {
    below.hidden = !below.hidden;
    if (below.hidden) return;
    cell.textContent = "reading …";
    const reply = await this.ask({ do: "results", run: run.name });
    cell.replaceChildren(reply.done ? element("dl", {}, ...reply.found.flatMap(([what, value]) =>
      [element("dt", { textContent: what }), element("dd", { textContent: value })])) : reply.text);
  }

  // The job as the server tells it; null: there was none yet.
  job(job) {
    $("job").hidden = !job;
    if (!job) return;
    setText($("job-title"), job.title);
    $("job").dataset.state = job.running ? "running" : job.failed ? "failed" : "done";
    $("job-bar").hidden = $("job-end").hidden = !job.running;
    const last = job.lines[job.lines.length - 1] ?? "";
    // A reader is told of the end, and not of every second before it.
    $("job-now").ariaLive = job.running ? "off" : "polite";
    setText($("job-now"), job.running ? `${job.took_s.toFixed(0)} s${last && `: ${last}`}`
      : `${job.failed || "done"}, ${job.took_s.toFixed(0)} s`);
    setText($("job-lines"), job.lines.join("\n"));
    $("job-more").open ||= Boolean(job.failed);
    $("job-report").hidden = !job.report;
    if (job.report) $("job-report").href = job.report;
    if (this.wasRunning && !job.running && $("runs").open) this.list();
    this.wasRunning = job.running;
  }

  async experiments() {
    if ($("experiment").options.length) return;
    const reply = await this.ask({ do: "experiments" });
    if (!reply.done) return setText($("experiment-note"), reply.text);
    const forms = reply.found;
    $("experiment").replaceChildren(...forms.map((form) => element("option", { value: form.tag, textContent: form.title })));
    $("experiment").onchange = () => this.experiment(forms.find((form) => form.tag === $("experiment").value));
    $("experiment").onchange();
  }

  experiment(form) {
    const host = $("experiment-form");
    host.replaceChildren();
    const read = build(host, form);
    const asked = () => ({ experiment: form.tag, settings: read() });
    host.append(element("div", { className: "row" }, element("button", { textContent: "Go", value: "go",
      title: "Arms the bench, runs the experiment, disarms" })));
    host.onsubmit = (event) => {
      event.preventDefault();
      this.begin({ kind: "experiment", ...asked() });
    };
    previewed(host, $("experiment-preview"), this.ask,
      () => ({ do: "preview_experiment", ...asked() }), this.channel, this.limit);
  }
}
