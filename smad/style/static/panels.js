// The panels and planes of a page of one file: drawn from the data beside this script.

import uPlot from "./vendor/uPlot.js";
import { Plane } from "./plane.js";
import { saveButtons, sheetOf, spanOf } from "./sheet.js";
import { axis, closest, curve, drawMarks, element, nearest, onScheme, setText, shown } from "./plots.js";

const PANEL_HEIGHT = 190;
const PAPER_WIDTH = 680; // what a sheet holds, in its own pixels
const PLANE_PAPER_WIDTH = 330;

class Panels {
  constructor(figure, number) {
    this.key = `panels-${number}`;
    this.data = JSON.parse(figure.querySelector("script").textContent);
    this.hidden = new Set();
    this.zooming = false;
    this.pointer = element("output");
    this.host = element("div");
    const beside = element("div", { className: "planes" });
    figure.prepend(...(this.data.panels.length ? [this.tools()] : []), this.host, beside);
    this.panels = this.data.panels.map((panel, i) => new Panel(this, panel, i === 0));
    this.host.append(...this.panels.map((panel) => panel.box));
    this.panels.forEach((panel) => panel.begin());
    this.planes = this.data.planes.map((plane) => this.plane(beside, plane));
    new ResizeObserver(() => this.resize()).observe(figure);
  }

  plane(host, given) {
    const values = (at) => (at == null ? undefined : this.data.values[at]);
    const made = new Plane(host, given);
    made.all = given.curves.map(({ x, y, t, cycle, ...rest }) =>
      ({ ...rest, x: values(x), y: values(y), t: values(t), cycle: values(cycle) }));
    made.set(made.all);
    return made;
  }

  tools() {
    const whole = element("button", { type: "button", textContent: "Show all" });
    whole.onclick = () => this.zoom(null, null);
    const bar = element("p", { className: "tools" }, whole);
    const groups = [...new Set(this.data.panels.flatMap((p) => p.traces.map((t) => t.group)))];
    for (const group of groups.length > 1 ? groups : []) {
      const pen = this.data.panels.flatMap((p) => p.traces).find((t) => t.group === group).pen;
      bar.append(this.tick(group, true, (on) => this.show(group, on), pen));
    }
    this.data.panels.forEach((panel, i) => {
      if (panel.on_demand) bar.append(this.tick(panel.title, false, (on) => this.panels[i].reveal(on)));
    });
    bar.append(saveButtons((mm) => this.sheet(mm), () => document.title), this.pointer, element("span", { className: "hint",
      textContent: "Drag to zoom, double click for all; click a name to hide its line." }));
    return bar;
  }

  // What is shown now, for paper.
  sheet(mm) {
    const { min, max } = this.panels[0].plot.scales.x;
    const boxes = this.panels.filter(({ box }) => !box.hidden).map(({ panel, off }) => {
      const lines = panel.traces.filter((trace, i) => !off.has(i) && !this.hidden.has(trace.group))
        .map(({ x, y, pen, dash, label }) => ({ x: this.data.xs[x], y, pen, dash, label }));
      return { title: panel.title, unit: panel.unit, x: [min, max], y: spanOf(lines, [min, max]), lines };
    });
    return sheetOf(boxes, this.data.x_label, mm);
  }

  tick(text, checked, changed, pen = "") {
    const box = element("input", { type: "checkbox", checked });
    box.onchange = () => changed(box.checked);
    const label = element("label", {}, box, ` ${text}`);
    if (pen) label.style.borderBottom = `3px solid var(--${pen})`;
    return label;
  }

  show(group, on) {
    this.hidden[on ? "delete" : "add"](group);
    this.panels.forEach((panel) => panel.showLines());
    this.planes.forEach((plane) => plane.set(plane.all.filter((curve) => !this.hidden.has(curve.group))));
  }

  // To all panels; null: to the whole.
  zoom(min, max) {
    if (this.zooming) return;
    this.zooming = true;
    const ends = this.data.xs.filter((x) => x.length);
    const range = min == null
      ? { min: Math.min(...ends.map((x) => x[0])), max: Math.max(...ends.map((x) => x[x.length - 1])) }
      : { min, max };
    for (const { plot } of this.panels) plot.batch(() => plot.setScale("x", range));
    for (const plane of this.planes ?? []) plane.show(range.min, range.max);
    this.zooming = false;
  }

  resize(width = this.host.clientWidth, planeWidth = undefined) {
    if (!width) return;
    for (const { plot, box } of this.panels) if (!box.hidden) plot.setSize({ width, height: PANEL_HEIGHT });
    for (const plane of this.planes) plane.resize(planeWidth);
  }

  redraw() {
    for (const { plot } of this.panels) plot.redraw();
    for (const plane of this.planes) plane.redraw();
  }
}

class Panel {
  constructor(all, panel, first) {
    this.all = all;
    this.panel = panel;
    this.first = first;
    this.off = new Set();
    this.names = panel.traces.map((trace, i) => {
      const name = element("button", { type: "button", className: "trace", ariaPressed: true });
      name.style.color = `var(--${trace.pen})`;
      name.onclick = () => {
        this.off[this.off.has(i) ? "delete" : "add"](i);
        this.showLines();
      };
      return name;
    });
    const unit = panel.unit ? ` (${panel.unit})` : "";
    this.box = element("div", { className: "panel", hidden: panel.on_demand },
      element("h3", {}, `${panel.title}${unit}`, ...this.names));
  }

  begin() {
    const { xs } = this.all.data;
    const tables = this.panel.traces.map((trace) => [xs[trace.x], trace.y]);
    this.plot = new uPlot(this.options(), uPlot.join(tables), this.box);
    this.label(null);
  }

  options() {
    return {
      width: Math.max(300, this.all.host.clientWidth),
      height: PANEL_HEIGHT,
      legend: { show: false },
      cursor: {
        drag: { x: true, y: false },
        sync: { key: this.all.key, setSeries: false, filters: { pub: (type) => /^mouse(move|leave)/.test(type) } },
        dataIdx: (plot, series, at) => nearest(plot.data[series], at),
      },
      scales: { x: { time: false } },
      axes: [axis({ size: 26, space: 80, ...this.xLabel() }), axis({ size: 56, space: 24 })],
      series: [{}, ...this.panel.traces.map((trace) => curve(trace.pen, trace.dash))],
      hooks: {
        setScale: [(plot, key) => {
          if (key === "x") this.all.zoom(plot.scales.x.min, plot.scales.x.max);
        }],
        setCursor: [(plot) => this.label(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null)],
        draw: [(plot) => drawMarks(plot, this.all.data.marks, this.first)],
      },
    };
  }

  // Under the lowest panel only: they share the axis.
  xLabel() {
    const lowest = this.all.data.panels.filter((panel) => !panel.on_demand).pop();
    return this.panel === lowest ? { label: this.all.data.x_label } : {};
  }

  label(x) {
    if (!this.plot) return;
    const { digits, unit, traces } = this.panel;
    traces.forEach((trace, i) => {
      const xs = this.all.data.xs[trace.x];
      const inside = x != null && xs.length && x >= xs[0] && x <= xs[xs.length - 1];
      const value = x == null ? ""
        : ` ${shown(inside ? trace.y[nearest(trace.y, closest(xs, x))] : null, digits)} ${unit}`;
      setText(this.names[i], `${trace.label}${value}`);
    });
    if (this.first) this.all.pointer.textContent = `${this.all.data.x_label}: ${shown(x, 3)}`;
  }

  showLines() {
    this.panel.traces.forEach((trace, i) => {
      const show = !this.off.has(i) && !this.all.hidden.has(trace.group);
      this.names[i].classList.toggle("off", !show);
      this.names[i].ariaPressed = show;
      this.plot.setSeries(i + 1, { show });
    });
  }

  reveal(on) {
    this.box.hidden = !on;
    this.all.resize();
  }
}

const all = [...document.querySelectorAll("figure.panels")].map((figure, i) => new Panels(figure, i));
onScheme(() => all.forEach((figure) => figure.redraw()));
window.onbeforeprint = () => {
  document.documentElement.classList.add("paper");
  all.forEach((figure) => { figure.resize(PAPER_WIDTH, PLANE_PAPER_WIDTH); figure.redraw(); });
};
window.onafterprint = () => {
  document.documentElement.classList.remove("paper");
  all.forEach((figure) => { figure.resize(); figure.redraw(); });
};
