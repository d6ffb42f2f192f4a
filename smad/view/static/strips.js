// The strips: one uPlot each, all on the same time, drawn at most once for each screen refresh.

import uPlot from "./style/vendor/uPlot.js";
import { options } from "./layout.js";
import { around, button, clock, limitLines } from "./plot.js";
import { axis, curve, drawMarks, element, setText, shown } from "./style/plots.js";
import { sheetOf, spanOf } from "./style/sheet.js";

const HEIGHT = 150;
const NEAR = 0.1; // of a limit
const PENS = 6; // colours for runs, which serve where two curves of a strip have one pen
const MOST_UNITS = 2;
const DRAGGED = "application/x-smad-strip";
const UNITS_S = [["h", 3600], ["min", 60], ["s", 1]];

export class Strips {
  constructor(host, data, view, layout) {
    Object.assign(this, { host, data, view, layout });
    this.strips = [];
    this.pointed = () => {}; // told the time under the pointer, or null
    this.sizes = new ResizeObserver(() => this.strips.forEach((strip) => strip.resize()));
    this.sizes.observe(host);
    this.build();
  }

  // Those whose channels stay keep their plot.
  build() {
    const old = this.strips;
    const open = new Set(old.filter((strip) => strip.editor.open).map((strip) => strip.key));
    this.strips = this.layout.strips.map((names, at) => {
      const place = old.findIndex((strip) => strip.key === names.join());
      const strip = place < 0 ? new Strip(this, names) : old.splice(place, 1)[0];
      strip.at = at;
      return strip;
    });
    old.forEach((strip) => strip.plot.destroy());
    // A strip that was changed by its editor keeps it open.
    if (old.length === 1 && open.has(old[0].key)) {
      const changed = this.strips.find((strip) => strip.fresh);
      if (changed) changed.editor.open = true;
    }
    this.strips.forEach((strip) => { strip.fresh = false; });
    this.host.replaceChildren(...this.strips.map((strip) => strip.box));
    this.strips.forEach((strip) => strip.resize());
  }

  close() {
    this.sizes.disconnect();
    this.strips.forEach((strip) => strip.plot.destroy());
  }

  draw() {
    for (const strip of this.strips) strip.draw();
  }

  // What is shown now, for paper.
  sheet(mm) {
    const { data, view } = this;
    const { t, y } = data.drawn(view.live);
    const [from, to] = view.range;
    const [unit, length] = UNITS_S.find(([, seconds]) => seconds === 1 || to - from > 3 * seconds);
    const x = t.map((at) => (at - from) / length);
    const range = [0, (to - from) / length];
    // What has another unit has a panel of its own: a figure has one axis on the left.
    const boxes = this.strips.flatMap(({ layers, units, pens }) => units.map((of) => {
      const some = layers.filter((channel) => channel.unit === of);
      const lines = some.map((channel) => ({ x, y: y.get(channel.name) ?? [], pen: pens.get(channel),
        dash: channel.pen === "reference" ? [6, 4] : [], label: channel.label }));
      return { title: titled(some), unit: of, x: range, y: some[0].span ?? spanOf(lines, range), lines };
    }));
    return sheetOf(boxes, `time (${unit})`, mm);
  }
}

class Strip {
  constructor(all, names) {
    this.all = all;
    this.names = names;
    this.key = names.join();
    this.fresh = true;
    this.channels = names.map((name) => all.data.channels.get(name));
    this.units = [...new Set(this.channels.map((channel) => channel.unit))];
    this.pens = pensOf(this.channels);
    // What was measured is drawn over what was wanted.
    this.layers = [...this.channels].sort((a, b) => (b.pen === "reference") - (a.pen === "reference"));
    this.values = this.channels.map((channel) => {
      const value = element("span", { className: "value", title: channel.name });
      value.style.color = `var(--${this.pens.get(channel)})`;
      return value;
    });
    this.distance = element("span", { className: "distance" });
    const unit = this.units.length === 1 && this.units[0] ? ` (${this.units[0]})` : "";
    this.heading = element("h2", { draggable: true, title: "Drag to move this strip" }, `${titled(this.channels)}${unit}`,
      ...this.values, this.distance);
    this.editor = this.makeEditor();
    this.box = element("div", { className: "strip" }, this.heading, this.editor);
    this.box.dataset.strip = this.key;
    this.plot = new uPlot(this.options(), this.curves(all.data.drawn(all.view.live)), this.box);
    this.listen();
  }

  options() {
    const scales = Object.fromEntries(this.units.map((unit, k) => [`y${k}`,
      { range: (plot, low, high) => this.range(unit, low, high) }]));
    const sides = this.units.slice(0, MOST_UNITS).map((unit, k) => ({
      ...axis({ scale: `y${k}`, side: k ? 1 : 3, size: 50, space: 24 }),
      ...(k ? { grid: { show: false } } : {}),
      ...(this.units.length > 1 ? { label: unit, labelSize: 14 } : {}),
    }));
    return {
      width: 300,
      height: HEIGHT,
      legend: { show: false },
      cursor: {
        sync: { key: "strips", filters: { pub: (kind) => kind === "mousemove" || kind === "mouseleave" } },
        drag: { x: true, y: false, setScale: false },
      },
      scales: { x: { time: true, auto: false }, ...scales },
      axes: [axis({ size: 26, space: 80, values: clock }), ...sides],
      series: [{}, ...this.layers.map((channel) => ({
        ...curve(this.pens.get(channel), channel.pen === "reference" ? [6, 4] : []),
        scale: `y${this.units.indexOf(channel.unit)}`,
      }))],
      hooks: {
        draw: [() => this.lines()],
        setCursor: [() => this.label()],
        setSelect: [() => this.selected()],
      },
    };
  }

  // The pointer: drag zooms, ctrl with the wheel zooms, shift with it goes back and forth.
  listen() {
    const { view } = this.all;
    const at = (event) => this.plot.posToVal(event.offsetX, "x");
    this.plot.over.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.shiftKey) return;
      event.preventDefault();
      const turned = event.deltaY || event.deltaX;
      if (event.ctrlKey) view.zoom(turned > 0 ? 1.25 : 0.8, view.live ? undefined : at(event));
      else view.pan(Math.sign(turned) * 0.1);
    }, { passive: false });
    this.plot.over.addEventListener("dblclick", () => view.follow());
    this.heading.addEventListener("dragstart", (event) => {
      event.dataTransfer.setData(DRAGGED, String(this.at));
    });
    this.box.addEventListener("dragover", (event) => event.preventDefault());
    this.box.addEventListener("drop", (event) => {
      event.preventDefault();
      const from = event.dataTransfer.getData(DRAGGED);
      // Another thing that is dropped here, such as a file, is no strip.
      if (from) this.all.layout.move("strips", Number(from), this.at);
    });
  }

  selected() {
    const { left, width } = this.plot.select;
    if (width < 4) return;
    const [from, to] = [this.plot.posToVal(left, "x"), this.plot.posToVal(left + width, "x")];
    this.plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
    this.all.view.look(from, to);
  }

  makeEditor() {
    const { layout, data } = this.all;
    const set = (names) => (names.length
      ? layout.replace("strips", this.at, names) : layout.remove("strips", this.at));
    const chips = this.channels.map((channel) => button(`${channel.title} ${channel.label} ✕`,
      `Take ${channel.name} away`, () => set(this.names.filter((name) => name !== channel.name))));
    const free = (channel) => !this.names.includes(channel.name)
      && (this.units.includes(channel.unit) || this.units.length < MOST_UNITS);
    const add = element("select", { ariaLabel: "Add a channel to this strip" },
      element("option", { value: "", textContent: "add a channel …" }), ...options(data.channels, free));
    add.onchange = () => add.value && set([...this.names, add.value]);
    return element("details", { className: "editor" }, element("summary", { textContent: "⋯", title: "Change this strip", ariaLabel: "Change this strip" }),
      element("div", { className: "row" }, ...chips, add,
        button("↑", "Move this strip up", () => layout.move("strips", this.at, this.at - 1)),
        button("↓", "Move this strip down", () => layout.move("strips", this.at, this.at + 1)),
        button("Remove", "Remove this strip", () => layout.remove("strips", this.at))));
  }

  curves(drawn) {
    const none = [];
    return [drawn.t, ...this.layers.map(({ name }) => drawn.y.get(name)
      ?? (none.length ? none : Object.assign(none, drawn.t.map(() => null))))];
  }

  range(unit, low, high) {
    const some = this.channels.filter((channel) => channel.unit === unit);
    return some[0].span ?? around(low, high, Math.max(...some.map((channel) => channel.digits)));
  }

  resize() {
    const width = this.all.host.clientWidth;
    if (width) this.plot.setSize({ width, height: HEIGHT });
  }

  draw() {
    const { data, view } = this.all;
    const [min, max] = view.range;
    this.plot.batch(() => {
      this.plot.setData(this.curves(data.drawn(view.live)), false);
      this.plot.setScale("x", { min, max });
    });
    this.label();
  }

  lines() {
    const { data, view } = this.all;
    const limited = new Map(this.channels.filter((channel) => data.limits[channel.name] != null)
      .map((channel) => [channel.unit, channel]));
    for (const channel of limited.values()) {
      limitLines(this.plot, `y${this.units.indexOf(channel.unit)}`, channel, data.limits[channel.name]);
    }
    drawMarks(this.plot, data.marksDrawn(view.live), true);
  }

  // Values under the pointer, or else the newest shown; and how far the newest is from its limit.
  label() {
    if (!this.plot) return;
    const { data, view } = this.all;
    const { idx, left } = this.plot.cursor;
    const pointed = idx != null && left >= 0;
    const drawn = data.drawn(view.live);
    const at = pointed ? idx : drawn.t.length - 1;
    if (this.plot.over.matches(":hover")) this.all.pointed(pointed ? drawn.t[idx] : null);
    this.channels.forEach((channel, i) => {
      const value = view.live && !pointed ? data.now.get(channel.name) : drawn.y.get(channel.name)?.[at];
      setText(this.values[i], `${channel.label} ${shown(value, channel.digits)}${value == null ? "" : ` ${channel.unit}`}`);
    });
    const [text, near] = view.live ? distanceOf(this.channels, data) : ["", false];
    setText(this.distance, text);
    this.distance.classList.toggle("near", near);
  }
}

// How far the channel is from its limit that is nearest to it.
function distanceOf(channels, data) {
  let least = Infinity;
  let found = ["", false];
  for (const channel of channels) {
    const limit = data.limits[channel.name];
    const value = data.now.get(channel.name);
    if (limit == null || value == null || channel.pen === "reference") continue;
    const left = limit - (channel.both_ways ? Math.abs(value) : value);
    if (left / limit >= least) continue;
    least = left / limit;
    const of = `the limit of ${channel.both_ways ? "±" : ""}${limit}`;
    const digits = shown(Math.abs(left), channel.digits);
    // A reading at the limit is on either side of it by its noise.
    const away = Number(digits) === 0 ? "at" : `${digits} ${channel.unit} ${left < 0 ? "beyond" : "to"}`;
    found = [`${away} ${of}`, least < NEAR];
  }
  return found;
}

const titled = (channels) => [...new Set(channels.map((channel) => channel.title))].join(", ");

function pensOf(channels) {
  const used = new Set();
  return new Map(channels.map((channel) => {
    let pen = channel.pen;
    for (let k = 1; used.has(pen) && k <= PENS; k += 1) pen = `run-${k}`;
    used.add(pen);
    return [channel, pen];
  }));
}
