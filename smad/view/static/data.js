// What has come from the server: the live window, and the span that the page looks back at.

const scaled = (curve, by) =>
  (by === 1 ? curve : curve.map((value) => (value == null ? null : value * by)));

export class Data {
  constructor(hello) {
    this.channels = new Map(hello.channels.map((channel) => [channel.name, channel]));
    this.limits = hello.limits;
    this.marks = [];
    this.past = null;
    this.show([], [], 0, 0);
  }

  // What is asked for from now on; what is there stays on the screen until the answer comes.
  show(names, xyNames, spanS, tailS) {
    Object.assign(this, { names, xyNames, spanS, tailS });
    this.live ??= { t: [], y: new Map(), xy: emptyXy() };
    this.now ??= new Map();
  }

  get newest() {
    return this.live.t.length ? this.live.t[this.live.t.length - 1] : null;
  }

  // Points from `from_s` on are replaced; those that left the window are forgotten.
  take(frame) {
    const { t, y, xy } = this.live;
    const curves = this.named(this.names, frame.y);
    this.now = new Map(this.names.map((name, i) => [name, this.value(name, frame.now[i])]));
    if (frame.whole) {
      this.live = { t: frame.t, y: curves, xy: this.moments(this.xyNames, frame.xy) };
    } else {
      const cut = kept(t, frame.from_s, frame.t[frame.t.length - 1] - this.spanS);
      this.live = { t: renewed(t, cut, frame.t), y: new Map(), xy };
      for (const [name, curve] of curves) this.live.y.set(name, renewed(y.get(name) ?? [], cut, curve));
      if (frame.xy?.t.length) this.addMoments(frame.xy);
    }
  }

  addMoments(found) {
    const { xy } = this.live;
    const more = this.moments(this.xyNames, found);
    const cut = kept(xy.t, found.from_s, found.t[found.t.length - 1] - this.tailS);
    const y = new Map([...more.y].map(([name, curve]) => [name, renewed(xy.y.get(name) ?? [], cut, curve)]));
    this.live.xy = { t: renewed(xy.t, cut, more.t), cycle: renewed(xy.cycle, cut, more.cycle), y };
  }

  takePast(found, names, xyNames) {
    this.past = {
      t: found.frame.t,
      y: this.named(names, found.frame.y),
      xy: this.moments(xyNames, found.moments),
      marks: found.marks,
      source: found.source,
    };
  }

  moments(names, found) {
    return found ? { t: found.t, cycle: found.cycle, y: this.named(names, found.y) } : emptyXy();
  }

  named(names, curves) {
    return new Map(names.map((name, i) => [name, scaled(curves[i] ?? [], this.channels.get(name).scale)]));
  }

  value(name, value) {
    return value == null ? null : value * this.channels.get(name).scale;
  }

  // What is drawn: the past once it has come, or what is in the live window meanwhile.
  drawn(live) {
    return live ? this.live : this.past ?? this.live;
  }

  marksDrawn(live) {
    return live || !this.past ? this.marks : this.past.marks;
  }
}

const emptyXy = () => ({ t: [], cycle: [], y: new Map() });

function kept(t, fromS, oldestS) {
  let end = t.length;
  while (end > 0 && t[end - 1] >= fromS) end -= 1;
  let begin = 0;
  while (begin < end && t[begin] < oldestS) begin += 1;
  return [begin, end];
}

const renewed = (old, [begin, end], more) => old.slice(begin, end).concat(more);
