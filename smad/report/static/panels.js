// The panels of a page: drawn from the data beside this script, by the uPlot above it.
// Names and texts of a log go in as text, never as markup.

const HEIGHT = 190;
const PAPER_WIDTH = 680; // what a sheet holds, in its own pixels
const FAR = 400; // points between two samples of one run, where others lie in between

const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

const shown = (value, digits) => (value == null ? "–"
  : value.toFixed(digits).replace(/^-(?=0\.?0*$)/, "").replace("-", "−"));

class Panels {
  constructor(figure, number) {
    this.key = `panels-${number}`;
    this.data = JSON.parse(figure.querySelector("script").textContent);
    this.hidden = new Set();
    this.zooming = false;
    this.pointer = element("output");
    this.host = element("div");
    figure.prepend(this.tools(), this.host);
    this.panels = this.data.panels.map((panel, i) => new Panel(this, panel, i === 0));
    this.host.append(...this.panels.map((panel) => panel.box));
    this.panels.forEach((panel) => panel.begin());
    new ResizeObserver(() => this.resize()).observe(this.host);
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
    bar.append(this.pointer, element("span", { className: "hint",
      textContent: "Drag to zoom, double click for all; click a name to hide its line." }));
    return bar;
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
    this.zooming = false;
  }

  resize(width = this.host.clientWidth) {
    if (!width) return;
    for (const { plot, box } of this.panels) if (!box.hidden) plot.setSize({ width, height: HEIGHT });
  }

  redraw() {
    for (const { plot } of this.panels) plot.redraw();
  }
}

class Panel {
  constructor(all, panel, first) {
    this.all = all;
    this.panel = panel;
    this.first = first;
    this.off = new Set();
    this.names = panel.traces.map((trace, i) => {
      const name = element("button", { type: "button", className: "trace" });
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
    const axis = { stroke: () => css("--quiet"), font: "12px system-ui, sans-serif",
      grid: { stroke: () => css("--line"), width: 1 }, ticks: { stroke: () => css("--line"), width: 1 } };
    return {
      width: Math.max(300, this.all.host.clientWidth),
      height: HEIGHT,
      legend: { show: false },
      cursor: {
        drag: { x: true, y: false },
        sync: { key: this.all.key, setSeries: false, filters: { pub: (type) => /^mouse(move|leave)/.test(type) } },
        dataIdx: (plot, series, at) => nearest(plot.data[series], at),
      },
      scales: { x: { time: false } },
      axes: [{ ...axis, size: 26, space: 80, ...this.xLabel() }, { ...axis, size: 56, space: 24 }],
      series: [{}, ...this.panel.traces.map((trace) => ({
        stroke: () => css(`--${trace.pen}`),
        width: 1.5,
        dash: trace.dash.length ? trace.dash : undefined,
        points: { show: false },
        spanGaps: false,
      }))],
      hooks: {
        setScale: [(plot, key) => {
          if (key === "x") this.all.zoom(plot.scales.x.min, plot.scales.x.max);
        }],
        setCursor: [(plot) => this.label(plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null)],
        draw: [() => this.marks()],
      },
    };
  }

  // Under the lowest panel only: they share the axis.
  xLabel() {
    const lowest = this.all.data.panels.filter((panel) => !panel.on_demand).pop();
    return this.panel === lowest
      ? { label: this.all.data.x_label, labelSize: 20, labelGap: 2, labelFont: "12px system-ui, sans-serif" } : {};
  }

  label(x) {
    if (!this.plot) return;
    const { digits, unit, traces } = this.panel;
    traces.forEach((trace, i) => {
      const xs = this.all.data.xs[trace.x];
      const inside = x != null && xs.length && x >= xs[0] && x <= xs[xs.length - 1];
      const value = x == null ? ""
        : ` ${shown(inside ? trace.y[nearest(trace.y, closest(xs, x))] : null, digits)} ${unit}`;
      const text = `${trace.label}${value}`;
      if (this.names[i].textContent !== text) this.names[i].textContent = text;
    });
    if (this.first) this.all.pointer.textContent = `${this.all.data.x_label}: ${shown(x, 3)}`;
  }

  showLines() {
    this.panel.traces.forEach((trace, i) => {
      const show = !this.off.has(i) && !this.all.hidden.has(trace.group);
      this.names[i].classList.toggle("off", !show);
      this.plot.setSeries(i + 1, { show });
    });
  }

  reveal(on) {
    this.box.hidden = !on;
    this.all.resize();
  }

  marks() {
    const { ctx, bbox } = this.plot;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.strokeStyle = ctx.fillStyle = css("--quiet");
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    ctx.textAlign = "left";
    let free = -Infinity;
    for (const { x, text } of this.all.data.marks) {
      const at = this.plot.valToPos(x, "x", true);
      ctx.beginPath();
      ctx.moveTo(at, bbox.top);
      ctx.lineTo(at, bbox.top + bbox.height);
      ctx.stroke();
      // A text that would lie on the one before is left to the list of events.
      if (!this.first || at < free || at < bbox.left) continue;
      const width = ctx.measureText(text).width;
      const start = Math.min(at + 4 * devicePixelRatio, bbox.left + bbox.width - width);
      ctx.fillText(text, start, bbox.top + 12 * devicePixelRatio);
      free = start + width;
    }
    ctx.restore();
  }
}

// The place in increasing `xs` that is closest to `x`.
function closest(xs, x) {
  let [low, high] = [0, xs.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (xs[middle] <= x) low = middle;
    else high = middle;
  }
  return x - xs[low] <= xs[high] - x ? low : high;
}

// The place nearest to `at` where there is a value; the samples of several runs lie between each other.
function nearest(values, at) {
  if (values[at] !== undefined) return at;
  for (let step = 1; step < FAR; step += 1) {
    if (values[at - step] !== undefined) return at - step;
    if (values[at + step] !== undefined) return at + step;
  }
  return at;
}

const all = [...document.querySelectorAll("figure.panels")].map((figure, i) => new Panels(figure, i));
matchMedia("(prefers-color-scheme: dark)").onchange = () => all.forEach((one) => one.redraw());
window.onbeforeprint = () => {
  document.documentElement.classList.add("paper");
  all.forEach((one) => { one.resize(PAPER_WIDTH); one.redraw(); });
};
window.onafterprint = () => {
  document.documentElement.classList.remove("paper");
  all.forEach((one) => { one.resize(); one.redraw(); });
};
