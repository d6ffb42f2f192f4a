// One quantity against another: loops, the cycles of a run coloured by their number.

import uPlot from "./vendor/uPlot.js";
import { axis, clipped, css, element, shown } from "./plots.js";
import { saveButtons, sheetOf } from "./sheet.js";

const PLANE_HEIGHT = 280;
const MARGIN = 0.04; // of the range, around the curves
const REACH = 24; // pixels from the pointer to a sample that it names
const MOST_NAMED = 8; // cycles in a figure's key; of more, the first and the last
const FADES = 12; // steps in which a tail fades
const STOPS = ["cycle-first", "cycle-middle", "cycle-last"];

const parts = (hex) => [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));

// The colour of a cycle; `share` is 0 for the first and 1 for the last.
export function cycleColour(share) {
  const at = share * (STOPS.length - 1);
  const low = Math.min(Math.floor(at), STOPS.length - 2);
  const [from, to] = [low, low + 1].map((i) => parts(css(`--${STOPS[i]}`)));
  // As the palette writes it: programs that read a saved SVG know no newer notation.
  return `#${from.map((value, i) => Math.round(value + (at - low) * (to[i] - value)).toString(16).padStart(2, "0")).join("")}`;
}

// A plane in `host`. `given`: title; x and y, each with label, unit and digits. Its curves come by `set`.
export class Plane {
  constructor(host, given) {
    this.given = given;
    this.curves = [];
    this.range = [-Infinity, Infinity];
    this.value = element("output");
    this.legend = element("span", { className: "legend" });
    this.box = element("div", { className: "plane" }, element("h3", {}, given.title), this.legend, this.value);
    this.box.append(saveButtons((mm) => this.sheet(mm), () => `${document.title} ${given.title}`));
    host.append(this.box);
    this.plot = new uPlot(this.options(), [[0, 1], [0, 1]], this.box);
  }

  // What is shown now, for paper; a line for each cycle, in its colour.
  sheet(mm) {
    const { x, y } = this.given;
    const lines = this.curves.flatMap((curve) => {
      const [begin, end] = this.within(curve.t, curve.x.length);
      const cycles = curve.cycle && this.cycles > 1 ? [...new Set(curve.cycle.slice(begin, end))] : [null];
      const last = cycles.length - 1;
      const key = (number, n) => (last >= MOST_NAMED && n && n < last ? "" : `${n ? "" : "cycle "}${number}`);
      // The first point of the next cycle ends a line, so that no gap is left.
      const has = (number, i) => number == null || curve.cycle[i] === number || (i > begin && curve.cycle[i - 1] === number);
      return cycles.map((number, n) => ({
        x: curve.x.map((value, i) => (i < begin || i >= end || !has(number, i) ? null : value)),
        y: curve.y, pen: curve.pen, dash: curve.dash, label: number == null ? curve.label : key(number, n),
        colour: number == null ? undefined : cycleColour((number - 1) / (this.cycles - 1)),
      }));
    });
    const range = (name) => { const { min, max } = this.plot.scales[name]; return [min, max]; };
    const box = { title: `${y.label} (${y.unit})`, unit: "", x: range("x"), y: range("y"), lines, ticks: 5 };
    return sheetOf([box], `${x.label} (${x.unit})`, mm, (0.7 * mm * 72) / 25.4);
  }

  options() {
    const { x, y } = this.given;
    const name = (quantity) => `${quantity.label} (${quantity.unit})`;
    return {
      width: Math.max(260, this.box.clientWidth),
      height: PLANE_HEIGHT,
      legend: { show: false },
      cursor: { drag: { x: true, y: true, uni: 20 }, points: { show: false },
        bind: { dblclick: () => () => this.whole() } },
      // Set by hand, as the curves are drawn by hand: uPlot knows only two corners.
      scales: { x: { time: false, auto: false }, y: { auto: false } },
      axes: [axis({ size: 34, space: 70, label: name(x) }), axis({ size: 64, space: 28, label: name(y) })],
      series: [{}, { paths: () => null, points: { show: false } }],
      hooks: { draw: [() => this.draw()], setCursor: [() => this.point()] },
    };
  }

  // Curves of equally long `x` and `y`; `t` and `cycle` where there are any. `pen` colours what has no
  // cycles, `fade` lets the older part fade.
  set(curves) {
    this.curves = curves;
    this.cycles = Math.max(0, ...curves.map(({ cycle }) => (cycle ? cycle[cycle.length - 1] : 0)));
    this.tell();
    this.whole();
  }

  // Show all of it, as a double click does.
  whole() {
    const [x, y] = [this.ends("x"), this.ends("y")];
    this.plot.batch(() => {
      this.plot.setData([x, y], false);
      this.plot.setScale("x", { min: x[0], max: x[1] });
      this.plot.setScale("y", { min: y[0], max: y[1] });
    });
  }

  // Only what lies between two times, from now on.
  show(from, to) {
    this.range = [from, to];
    this.plot.redraw();
  }

  resize(width = this.box.clientWidth) {
    if (width) this.plot.setSize({ width, height: PLANE_HEIGHT });
  }

  redraw() {
    this.tell();
    this.plot.redraw();
  }

  ends(name) {
    let [low, high] = [Infinity, -Infinity];
    for (const curve of this.curves) {
      for (const value of curve[name]) {
        if (value == null) continue;
        if (value < low) low = value;
        if (value > high) high = value;
      }
    }
    if (low > high) return [0, 1];
    const margin = Math.max(MARGIN * (high - low), 10 ** -this.given[name].digits);
    return [low - margin, high + margin];
  }

  tell() {
    const names = this.curves.filter(({ cycle }) => !cycle || this.cycles < 2).map(({ label, pen }) =>
      element("span", { textContent: label, style: `color: var(--${pen})` }));
    if (this.cycles > 1) {
      const bar = element("i", { style: `background: linear-gradient(90deg, ${STOPS.map((s) => `var(--${s})`)})` });
      names.push(element("span", {}, "cycle 1 ", bar, ` ${this.cycles}`));
    }
    this.legend.replaceChildren(...names);
  }

  draw() {
    clipped(this.plot, (ctx) => {
      ctx.lineWidth = 1.5 * devicePixelRatio;
      ctx.lineJoin = "round";
      for (const curve of this.curves) this.trace(ctx, curve);
    });
  }

  // A stroke for each stretch of one colour: a cycle, or a step of the fading tail.
  trace(ctx, curve) {
    const { x, y, t, cycle, fade } = curve;
    const [begin, end] = this.within(t, x.length);
    ctx.setLineDash((curve.dash ?? []).map((length) => length * devicePixelRatio));
    const step = (i) => (fade ? Math.floor((FADES * (i - begin)) / (end - begin)) : 0);
    for (let i = begin; i < end;) {
      const [number, age] = [cycle?.[i], step(i)];
      ctx.strokeStyle = cycle && this.cycles > 1
        ? cycleColour((number - 1) / (this.cycles - 1)) : css(`--${curve.pen}`);
      ctx.globalAlpha = fade ? (age + 1) / FADES : 1;
      ctx.beginPath();
      let open = false;
      // The first point of the next stretch ends this one, so that no gap is left.
      for (let last = false; i < end && !last; i += 1) {
        last = cycle?.[i] !== number || step(i) !== age;
        if (x[i] == null || y[i] == null) {
          open = false;
          continue;
        }
        const at = [this.plot.valToPos(x[i], "x", true), this.plot.valToPos(y[i], "y", true)];
        if (open) ctx.lineTo(...at);
        else ctx.moveTo(...at);
        open = true;
        if (last) i -= 1;
      }
      ctx.stroke();
    }
    ctx.globalAlpha = 1;
  }

  within(t, length) {
    if (!t) return [0, length];
    let [begin, end] = [0, length];
    while (begin < end && t[begin] < this.range[0]) begin += 1;
    while (end > begin && t[end - 1] > this.range[1]) end -= 1;
    return [begin, end];
  }

  // The sample nearest to the pointer: both values, its cycle and its time.
  point() {
    const { left, top } = this.plot.cursor;
    const found = left < 0 ? null : this.near(left, top);
    if (!found) {
      this.value.textContent = "";
      return;
    }
    const [curve, i] = found;
    const { x, y } = this.given;
    const words = [`${shown(curve.x[i], x.digits)} ${x.unit}, ${shown(curve.y[i], y.digits)} ${y.unit}`];
    if (curve.cycle && this.cycles > 1) words.push(`cycle ${curve.cycle[i]}`);
    else words.push(curve.label);
    if (curve.t) words.push(`${shown(curve.t[i], 1)} s`);
    this.value.textContent = words.join("; ");
  }

  near(left, top) {
    let [found, least] = [null, REACH ** 2];
    for (const curve of this.curves) {
      const [begin, end] = this.within(curve.t, curve.x.length);
      for (let i = begin; i < end; i += 1) {
        if (curve.x[i] == null || curve.y[i] == null) continue;
        const away = (this.plot.valToPos(curve.x[i], "x") - left) ** 2
          + (this.plot.valToPos(curve.y[i], "y") - top) ** 2;
        if (away < least) [found, least] = [[curve, i], away];
      }
    }
    return found;
  }
}
