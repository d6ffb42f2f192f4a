// The plots: one uPlot a strip, all on the same time, drawn at most once for each screen refresh.

import { axis, clipped, css, curve, drawMarks, element, line, onScheme, setText, shown } from "./style/plots.js";
import uPlot from "./style/vendor/uPlot.js";

export { element, setText };

const HEIGHT = 150;
const MOST_MARKS = 50;
const NEAR = 0.1; // of a limit

export class Strips {
  constructor(host, hello, drawn) {
    this.host = host;
    this.drawn = drawn; // told when a frame is on the screen
    this.columns = hello.strips.flatMap((strip) => strip.curves.map((curve) => strip.scale));
    this.limits = hello.limits;
    this.fit = false;
    this.spanS = hello.windows[0].span_s;
    this.t = [];
    this.y = this.columns.map(() => []);
    this.now = this.columns.map(() => null);
    this.marks = [];
    this.frames = 0;
    this.asked = false;
    let first = 0;
    this.strips = hello.strips.map((strip) => {
      const made = new Strip(this, strip, first);
      first += strip.curves.length;
      return made;
    });
    host.replaceChildren(...this.strips.map((strip) => strip.box));
    this.sizes = new ResizeObserver(() => this.strips.forEach((strip) => strip.resize()));
    this.sizes.observe(host);
    this.light = onScheme(() => this.strips.forEach((strip) => strip.plot.redraw()));
    this.strips.forEach((strip) => strip.resize());
  }

  close() {
    this.sizes.disconnect();
    this.light();
    this.strips.forEach((strip) => strip.plot.destroy());
  }

  // Points from `from_s` on are replaced; those that left the window are forgotten.
  take(frame) {
    const scaled = frame.y.map((curve, i) => scale(curve, this.columns[i]));
    this.now = frame.now.map((value, i) => (value == null ? null : value * this.columns[i]));
    if (frame.whole) {
      this.t = frame.t;
      this.y = scaled;
    } else {
      let keep = this.t.length;
      while (keep > 0 && this.t[keep - 1] >= frame.from_s) keep -= 1;
      const newest = frame.t[frame.t.length - 1];
      let begin = 0;
      while (begin < keep && this.t[begin] < newest - this.spanS) begin += 1;
      this.t = this.t.slice(begin, keep).concat(frame.t);
      this.y = this.y.map((curve, i) => curve.slice(begin, keep).concat(scaled[i]));
    }
    this.frames += 1;
    this.marks = this.marks.filter((mark) => mark.x >= this.t[0]);
    this.draw();
  }

  draw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      for (const strip of this.strips) strip.draw();
      for (; this.frames > 0; this.frames -= 1) this.drawn();
    });
  }

  // A line at the newest time: what was changed, so that its effect is seen beside it.
  mark(text) {
    if (this.t.length) this.marks.push({ x: this.t[this.t.length - 1], text });
    if (this.marks.length > MOST_MARKS) this.marks.shift();
  }

  show(name, visible) {
    const strip = this.strips.find((one) => one.strip.name === name);
    strip.box.hidden = !visible;
    strip.resize();
    strip.draw();
  }
}

const scale = (curve, by) =>
  by === 1 ? curve : curve.map((value) => (value == null ? null : value * by));

class Strip {
  constructor(all, strip, first) {
    this.all = all;
    this.strip = strip;
    this.first = first;
    this.values = strip.curves.map((curve) =>
      element("span", { className: `value pen-${curve.pen}` }));
    this.distance = element("span", { className: "distance" });
    const heading = element("h2", {}, strip.title, ...this.values, this.distance);
    this.box = element("div", { className: "strip", hidden: strip.on_demand }, heading);
    this.box.dataset.strip = strip.name;
    this.plot = new uPlot(this.options(), this.data(), this.box);
  }

  options() {
    return {
      width: 300,
      height: HEIGHT,
      legend: { show: false },
      cursor: { sync: { key: "strips" }, drag: { x: false, y: false } },
      scales: { x: { time: true, auto: false }, y: { range: (plot, low, high) => this.range(low, high) } },
      axes: [axis({ size: 26, space: 80, values: clock }), axis({ size: 46, space: 24 })],
      series: [{}, ...this.strip.curves.map(({ pen }) => curve(pen, pen === "reference" ? [6, 4] : []))],
      hooks: { draw: [() => this.lines()], setCursor: [() => this.label()] },
    };
  }

  data() {
    const last = this.first + this.strip.curves.length;
    return [this.all.t, ...this.all.y.slice(this.first, last)];
  }

  range(low, high) {
    const limit = this.all.limits[this.strip.name];
    const wanted = [low, high].filter((value) => value != null);
    if (!this.all.fit) {
      wanted.push(...[this.strip.least, this.strip.most].filter((value) => value != null));
      if (limit != null) wanted.push(limit, ...(this.strip.both_ways ? [-limit] : []));
    }
    if (!wanted.length) return [0, 1];
    const [least, most] = [Math.min(...wanted), Math.max(...wanted)];
    const margin = Math.max(0.06 * (most - least), 0.5 * 10 ** -this.strip.digits);
    return [least - margin, most + margin];
  }

  resize() {
    const width = this.all.host.clientWidth;
    if (width && !this.box.hidden) this.plot.setSize({ width, height: HEIGHT });
  }

  draw() {
    if (this.box.hidden) return;
    const { t, spanS } = this.all;
    this.plot.batch(() => {
      this.plot.setData(this.data(), false);
      const newest = t.length ? t[t.length - 1] : Date.now() / 1000;
      this.plot.setScale("x", { min: newest - spanS, max: newest });
    });
    this.label();
  }

  // The limits, and the marks of what was changed.
  lines() {
    const limit = this.all.limits[this.strip.name];
    if (limit != null) {
      clipped(this.plot, (ctx, bbox) => {
        ctx.strokeStyle = css("--limit");
        ctx.setLineDash([8 * devicePixelRatio, 4 * devicePixelRatio]);
        for (const value of this.strip.both_ways ? [limit, -limit] : [limit]) {
          const y = this.plot.valToPos(value, "y", true);
          line(ctx, bbox.left, y, bbox.left + bbox.width, y);
        }
      });
    }
    drawMarks(this.plot, this.all.marks, true);
  }

  // Values under the pointer, or else the newest; and how far the newest is from its limit.
  label() {
    if (!this.plot) return;
    const at = this.plot.cursor.idx;
    const pointed = at != null && this.plot.cursor.left >= 0;
    const { curves, digits, unit, both_ways: bothWays } = this.strip;
    const newest = curves.map((curve, i) => this.all.now[this.first + i]);
    curves.forEach((curve, i) => {
      const value = pointed ? this.all.y[this.first + i][at] : newest[i];
      setText(this.values[i], `${curve.label} ${shown(value, digits)} ${unit}`);
    });
    const limit = this.all.limits[this.strip.name];
    const measured = newest.filter((value, i) => value != null && curves[i].pen !== "reference");
    if (limit == null || !measured.length) return setText(this.distance, "");
    const left = limit - Math.max(...measured.map((v) => (bothWays ? Math.abs(v) : v)));
    setText(this.distance, left < 0
      ? `${shown(-left, digits)} ${unit} beyond the limit of ${limit}`
      : `${shown(left, digits)} ${unit} to the limit of ${limit}`);
    this.distance.classList.toggle("near", left < NEAR * limit);
  }
}

function clock(plot, splits) {
  const digits = (number) => String(number).padStart(2, "0");
  return splits.map((seconds) => {
    const at = new Date(seconds * 1000);
    return `${digits(at.getHours())}:${digits(at.getMinutes())}:${digits(at.getSeconds())}`;
  });
}
