// One channel against another, sample for sample: a tail that fades, cycles in colours by number.

import uPlot from "./style/vendor/uPlot.js";
import { options } from "./layout.js";
import { around, button, time } from "./plot.js";
import { cycleColour } from "./style/plane.js";
import { axis, clipped, css, element, setText, shown } from "./style/plots.js";

const HEIGHT = 260;
const NAMED = 6; // cycles in the legend, the newest
const FADES = 24; // steps from the oldest point to the newest
const GAP_S = 1.5;
const REACH = 40; // pixels from the pointer to the point that it shows

export class XyPlots {
  constructor(host, data, view, layout) {
    Object.assign(this, { host, data, view, layout });
    this.plots = [];
    this.sizes = new ResizeObserver(() => this.plots.forEach((xy) => xy.resize()));
    this.sizes.observe(host);
    this.build();
  }

  build() {
    this.plots.forEach((xy) => xy.plot.destroy());
    this.plots = this.layout.xy.map((pair, at) => new Xy(this, pair, at));
    this.host.replaceChildren(...this.plots.map((xy) => xy.box));
    this.plots.forEach((xy) => xy.resize());
  }

  close() {
    this.sizes.disconnect();
    this.plots.forEach((xy) => xy.plot.destroy());
  }

  draw() {
    for (const xy of this.plots) xy.draw();
  }

  // Show where the pair was at a time.
  point(at) {
    for (const xy of this.plots) {
      xy.at = at == null ? null : nearest(xy.points.t, at);
      xy.plot.redraw(false);
      xy.label();
    }
  }
}

class Xy {
  constructor(all, pair, at) {
    this.all = all;
    this.pair = pair;
    this.channels = pair.map((name) => all.data.channels.get(name));
    this.points = { t: [], cycle: [], x: [], y: [] };
    this.at = null;
    const choose = (place, label) => {
      const select = element("select", { ariaLabel: label }, ...options(all.data.channels));
      select.value = pair[place];
      select.onchange = () => all.layout.replace("xy", at,
        place ? [pair[0], select.value] : [select.value, pair[1]]);
      return select;
    };
    this.values = element("span", { className: "values" });
    this.cycles = element("span", { className: "cycles" });
    this.box = element("div", { className: "xy" },
      element("div", { className: "row" }, choose(1, "Upwards"),
        button("✕", "Remove this plot", () => all.layout.remove("xy", at))),
      element("div", { className: "row" }, "against", choose(0, "To the right")),
      element("p", { className: "small" }, this.values, this.cycles));
    this.box.dataset.xy = pair.join();
    this.plot = new uPlot(this.options(), [[0, 1], [null, null]], this.box);
    this.plot.over.addEventListener("mousemove", (event) => this.hover(event));
    this.plot.over.addEventListener("mouseleave", () => { this.at = null; this.label(); this.plot.redraw(false); });
  }

  options() {
    const [right, up] = this.channels;
    return {
      width: 300,
      height: HEIGHT,
      legend: { show: false },
      cursor: { show: false },
      scales: {
        x: { time: false, auto: false, range: () => this.range(right, this.points.x) },
        y: { auto: false, range: () => this.range(up, this.points.y) },
      },
      axes: [axis({ size: 34, label: named(right) }), axis({ size: 50, label: named(up) })],
      series: [{}, { paths: () => null, points: { show: false } }],
      hooks: { draw: [() => this.paint()] },
    };
  }

  range(channel, values) {
    let [low, high] = [null, null];
    for (const value of values) {
      if (value == null) continue;
      if (low == null || value < low) low = value;
      if (high == null || value > high) high = value;
    }
    return around(low, high, channel.digits);
  }

  resize() {
    const width = this.box.clientWidth;
    if (width) this.plot.setSize({ width, height: HEIGHT });
  }

  draw() {
    const { data, view } = this.all;
    const { t, cycle, y } = data.drawn(view.live).xy;
    const none = t.map(() => null);
    const [x, up] = this.pair.map((name) => y.get(name) ?? none);
    const [from, to] = view.range;
    // Back in time the tail is what the strips show, and at most as long as when it is live.
    const [begin, end] = view.live ? [0, t.length] : [firstFrom(t, from), firstFrom(t, to + 1e-9)];
    const part = (values) => values.slice(begin, end);
    this.points = { t: part(t), cycle: part(cycle), x: part(x), y: part(up) };
    this.plot.batch(() => {
      const [[x0, x1], [y0, y1]] = [this.range(this.channels[0], this.points.x), this.range(this.channels[1], this.points.y)];
      this.plot.setScale("x", { min: x0, max: x1 });
      this.plot.setScale("y", { min: y0, max: y1 });
    });
    this.plot.redraw(false);
    this.label();
  }

  paint() {
    const { t, cycle, x, y } = this.points;
    const colourOf = coloursOf(cycle);
    const fade = this.all.view.live;
    const last = t.length - 1;
    clipped(this.plot, (ctx) => {
      ctx.lineWidth = 1.5 * devicePixelRatio;
      ctx.lineJoin = ctx.lineCap = "round";
      const px = (k) => [this.plot.valToPos(x[k], "x", true), this.plot.valToPos(y[k], "y", true)];
      let group = null;
      for (let k = 1; k <= last; k += 1) {
        const step = fade ? Math.ceil((FADES * (k + 1)) / (last + 1)) : FADES;
        const next = `${cycle[k]} ${step}`;
        const joined = x[k] != null && y[k] != null && x[k - 1] != null && y[k - 1] != null
          && t[k] - t[k - 1] < GAP_S;
        if (next !== group) {
          if (group !== null) ctx.stroke();
          ctx.beginPath();
          ctx.strokeStyle = colourOf(cycle[k]);
          ctx.globalAlpha = 0.25 + 0.75 * (step / FADES) ** 2;
          if (joined) ctx.moveTo(...px(k - 1));
          group = next;
        }
        if (x[k] == null || y[k] == null) continue;
        if (joined) ctx.lineTo(...px(k));
        else dot(ctx, px(k));
      }
      if (group !== null) ctx.stroke();
      ctx.globalAlpha = 1;
      const shownAt = this.at ?? (fade ? last : -1);
      if (shownAt >= 0 && x[shownAt] != null && y[shownAt] != null) {
        ctx.fillStyle = css("--text");
        ctx.beginPath();
        ctx.arc(...px(shownAt), 4 * devicePixelRatio, 0, 2 * Math.PI);
        ctx.fill();
      }
    });
  }

  hover(event) {
    let [best, least] = [null, REACH ** 2];
    const { x, y } = this.points;
    for (let k = 0; k < x.length; k += 1) {
      if (x[k] == null || y[k] == null) continue;
      const away = (this.plot.valToPos(x[k], "x") - event.offsetX) ** 2
        + (this.plot.valToPos(y[k], "y") - event.offsetY) ** 2;
      if (away < least) [best, least] = [k, away];
    }
    this.at = best;
    this.plot.redraw(false);
    this.label();
  }

  label() {
    const { t, cycle, x, y } = this.points;
    const at = this.at ?? t.length - 1;
    const [right, up] = this.channels;
    setText(this.values, at < 0 ? "no samples here"
      : `${shown(y[at], up.digits)} ${up.unit} at ${shown(x[at], right.digits)} ${right.unit}, ${time(t[at])}`);
    const numbers = [...new Set(cycle)].slice(-NAMED);
    const colourOf = coloursOf(cycle);
    const text = `${cycle[0]}:${numbers.join()}`;
    this.box.dataset.cycles = numbers.join();
    this.box.dataset.points = String(t.length);
    if (this.told === text) return;
    this.told = text;
    this.cycles.replaceChildren(...(numbers.length ? [" cycle"] : []), ...numbers.map((number) => {
      const mark = element("b", { textContent: ` ${number + 1}` });
      mark.style.color = colourOf(number);
      return mark;
    }));
  }
}

// A point with nothing before it: of a long span one in so many is there, and no line says what lies between.
function dot(ctx, at) {
  ctx.moveTo(...at);
  ctx.lineTo(...at);
}

// The colour of each cycle that is shown, from the first to the last, as in a report.
function coloursOf(cycle) {
  const [first, last] = [cycle[0], cycle[cycle.length - 1]];
  const known = new Map();
  return (number) => {
    if (!known.has(number)) known.set(number, cycleColour(last > first ? (number - first) / (last - first) : 1));
    return known.get(number);
  };
}

// What is measured needs no further word: "Displacement, mm".
const named = (channel) => [channel.title, channel.label === "measured" ? "" : ` ${channel.label}`,
  channel.unit ? `, ${channel.unit}` : ""].join("");

function firstFrom(t, at) {
  let [low, high] = [0, t.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (t[middle] < at) low = middle + 1;
    else high = middle;
  }
  return low;
}

function nearest(t, at) {
  const k = firstFrom(t, at);
  if (!t.length) return null;
  return k > 0 && (k === t.length || at - t[k - 1] < t[k] - at) ? k - 1 : k;
}
