// Which span of time is shown: the newest seconds, or one in the past.

const LEAST_S = 0.2;

export class TimeView {
  // `changed` is told of each change; `newest` returns the time of the newest sample, or null.
  // What `before` showed is shown again: a daemon that was started anew, or another axis, moves no plot.
  constructor(windows, newest, changed, before = {}) {
    this.windows = windows;
    this.newest = newest;
    this.changed = changed;
    this.live = before.live ?? true;
    this.spanS = before.spanS ?? windows[0].span_s;
    this.toS = before.toS ?? 0;
    this.firstS = before.firstS ?? null;
  }

  // The finest window that has all of the span.
  get window() {
    const found = this.windows.findIndex((one) => one.span_s >= this.spanS - 1e-6);
    return found < 0 ? this.windows.length - 1 : found;
  }

  get range() {
    const to = this.live ? this.newest() ?? Date.now() / 1000 : this.toS;
    return [to - this.spanS, to];
  }

  get longestS() {
    return this.windows[this.windows.length - 1].span_s;
  }

  follow() {
    if (this.live) return;
    this.live = true;
    this.spanS = Math.min(this.spanS, this.longestS);
    this.changed();
  }

  pause() {
    if (this.live) this.look(...this.range);
  }

  look(from, to) {
    const newest = this.newest() ?? to;
    this.live = false;
    this.spanS = Math.min(Math.max(to - from, LEAST_S), this.longestS);
    this.toS = Math.min(Math.max(to, (this.firstS ?? from) + this.spanS), Math.max(newest, from + LEAST_S));
    this.changed();
  }

  // Live stays live; a span in the past keeps what is at `at` in its place.
  span(seconds, at = this.range[1]) {
    const [from, to] = this.range;
    const span = Math.min(Math.max(seconds, LEAST_S), this.longestS);
    if (this.live) {
      this.spanS = span;
      this.changed();
    } else {
      const share = (at - from) / (to - from);
      this.look(at - share * span, at + (1 - share) * span);
    }
  }

  zoom(factor, at) {
    const [from, to] = this.range;
    this.span(this.spanS * factor, at ?? (this.live ? to : (from + to) / 2));
  }

  pan(share) {
    const [from, to] = this.range;
    this.look(from + share * this.spanS, to + share * this.spanS);
  }
}
