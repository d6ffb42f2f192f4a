// All that is drawn of the bench, and the controls of time and layout around it.

import { Data } from "./data.js";
import { Layout, options } from "./layout.js";
import { day, time } from "./plot.js";
import { Strips } from "./strips.js";
import { element, onScheme, setText } from "./style/plots.js";
import { saveButtons } from "./style/sheet.js";
import { TimeView } from "./time.js";
import { XyPlots } from "./xy.js";

const $ = (id) => document.getElementById(id);
const LOOK_MS = 120; // after the last turn of the wheel the past is asked for

// Strips and XY plots over one store and one span of time; drawn once for each screen refresh.
export class Plots {
  constructor(hello, link, before) {
    this.link = link;
    this.data = new Data(hello);
    this.layout = new Layout(hello, () => this.arranged());
    this.view = new TimeView(hello.windows, () => this.data.newest, () => this.moved(), before);
    this.strips = new Strips($("strips"), this.data, this.view, this.layout);
    this.xys = new XyPlots($("xys"), this.data, this.view, this.layout);
    this.strips.pointed = (at) => this.xys.point(at);
    this.frames = 0;
    this.light = onScheme(() => this.draw());
    this.controls(hello);
    this.show();
  }

  close() {
    this.strips.close();
    this.xys.close();
    this.light();
    clearTimeout(this.asking);
  }

  controls(hello) {
    const { view, layout, data } = this;
    $("window").replaceChildren(...hello.windows.map((one) => element("option", { value: one.span_s, textContent: one.label })));
    const did = (id, what) => { $(id).onclick = what; };
    $("window").onchange = () => $("window").value && view.span(Number($("window").value));
    did("pause", () => (view.live ? view.pause() : view.follow()));
    did("zoom-in", () => view.zoom(0.5));
    did("zoom-out", () => view.zoom(2));
    did("back", () => view.pan(-0.5));
    did("forth", () => view.pan(0.5));
    $("scroll").oninput = () => view.look(Number($("scroll").value) - view.spanS, Number($("scroll").value));
    $("add-strip").replaceChildren(element("option", { value: "", textContent: "Add a strip …" }), ...options(data.channels));
    $("add-strip").onchange = () => {
      layout.add("strips", [$("add-strip").value]);
      $("add-strip").value = "";
    };
    did("add-xy", () => layout.add("xy", hello.layout.xy[layout.xy.length % hello.layout.xy.length]));
    $("tail").value = layout.tail_s;
    $("tail").onchange = () => layout.change({ tail_s: Number($("tail").value) });
    did("reset", () => layout.reset());
    $("save").replaceChildren(saveButtons((mm) => this.strips.sheet(mm),
      () => `${document.title} ${day(view.range[0], true)}${time(view.range[0])}`));
  }

  arranged() {
    $("tail").value = this.layout.tail_s;
    const { activeElement } = document;
    const place = [...$("xys").children].indexOf(activeElement.closest(".xy"));
    this.strips.build();
    this.xys.build();
    // Plots are made anew: whoever goes by keyboard stays where they were.
    const again = activeElement.isConnected ? activeElement
      : $("xys").children[place]?.querySelector(`[aria-label="${activeElement.ariaLabel}"]`)
        ?? document.querySelector(".editor[open] > summary");
    again?.focus();
    this.show();
  }

  moved() {
    const live = this.view.live;
    if (live !== this.wasLive || live) this.show();
    else this.lookBack();
    this.draw();
  }

  // Tell the server what is shown; what it sends is of that alone.
  show() {
    const { view, layout, data } = this;
    this.wasLive = view.live;
    const asked = { window: view.window, channels: layout.channels, xy: layout.xyChannels,
      tail_s: layout.tail_s, live: view.live };
    const text = JSON.stringify(asked);
    if (text !== this.asked || !view.live) {
      this.asked = text;
      this.shows = this.link.tell({ do: "show", ...asked });
      data.show(asked.channels, asked.xy, view.windows[view.window].span_s, layout.tail_s);
    }
    if (view.live) data.past = null;
    else this.lookBack();
    this.draw();
  }

  lookBack() {
    clearTimeout(this.asking);
    this.asking = setTimeout(async () => {
      const [from_s, to_s] = this.view.range;
      const [names, xyNames] = [this.layout.channels, this.layout.xyChannels];
      const reply = await this.link.ask({ do: "look_back", from_s, to_s });
      const now = this.view.range;
      if (!reply.done || this.view.live || names.join() !== this.layout.channels.join()
        || xyNames.join() !== this.layout.xyChannels.join()) return;
      this.data.takePast(reply.found, names, xyNames);
      document.body.dataset.past = now[0] === from_s && now[1] === to_s ? `${from_s} ${to_s}` : "";
      this.draw();
    }, LOOK_MS);
  }

  // Whether a frame is of what is shown now.
  take(frame) {
    if (frame.view !== this.shows || !this.view.live) return false;
    this.data.take(frame);
    this.frames += 1;
    this.draw();
    return true;
  }

  marks(marks) {
    this.data.marks = marks;
    this.draw();
  }

  session(firstS) {
    this.view.firstS = firstS;
    this.span();
  }

  draw() {
    if (this.drawing) return;
    this.drawing = true;
    requestAnimationFrame(() => {
      this.drawing = false;
      this.strips.draw();
      this.xys.draw();
      this.span();
      for (; this.frames > 0; this.frames -= 1) this.link.send({ do: "drawn" });
    });
  }

  // The controls of time, as they are now.
  span() {
    const { view, data } = this;
    const [from, to] = view.range;
    const at = (seconds) => time(seconds, view.spanS < 10 ? 1 : 0);
    setText($("pause"), view.live ? "Pause" : "Live");
    document.body.dataset.time = view.live ? "live" : "past";
    $("back").disabled = view.firstS != null && from <= view.firstS;
    $("forth").disabled = view.live || to >= (data.newest ?? to);
    const known = [...$("window").options].find((one) => Math.abs(Number(one.value) - view.spanS) < 0.01);
    $("window").value = known ? known.value : "";
    const scroll = $("scroll");
    scroll.min = Math.min(view.firstS ?? from, from);
    scroll.max = data.newest ?? to;
    if (document.activeElement !== scroll || view.live) scroll.value = to;
    scroll.ariaValueText = view.live ? "now" : `${day(to)}${at(to)}`;
    setText($("span"), view.live ? lasting(view.spanS)
      : `Paused: ${day(from)}${at(from)} to ${at(to)}, ${lasting(view.spanS)}${data.past ? `, from ${data.past.source}` : ""}`);
  }
}

function lasting(seconds) {
  if (seconds >= 5400) return `${(seconds / 3600).toFixed(1)} h`;
  return seconds >= 120 ? `${(seconds / 60).toFixed(1)} min` : `${seconds.toFixed(seconds < 10 ? 1 : 0)} s`;
}
