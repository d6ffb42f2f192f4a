// Which strips and XY plots there are, in which order: kept by the browser, for this address.

const KEY = "smad-layout";

export class Layout {
  constructor(hello, changed) {
    this.known = new Set(hello.channels.map((channel) => channel.name));
    this.first = { ...hello.layout, tail_s: 60 };
    this.changed = changed;
    Object.assign(this, this.checked(read()) ?? structuredClone(this.first));
  }

  // What somebody else wrote there, or an older page, is left out.
  checked(found) {
    if (!found || !Array.isArray(found.strips) || !Array.isArray(found.xy)) return null;
    const lists = (some) => some.filter(Array.isArray)
      .map((names) => names.filter((name) => this.known.has(name)));
    return {
      strips: lists(found.strips).filter((names) => names.length),
      xy: lists(found.xy).filter((names) => names.length === 2),
      tail_s: found.tail_s > 0 && found.tail_s <= 300 ? found.tail_s : this.first.tail_s,
    };
  }

  get channels() {
    return [...new Set(this.strips.flat())];
  }

  get xyChannels() {
    return [...new Set(this.xy.flat())];
  }

  change(more) {
    Object.assign(this, more);
    const { strips, xy, tail_s } = this;
    try {
      localStorage.setItem(KEY, JSON.stringify({ strips, xy, tail_s }));
    } catch { /* a browser that keeps nothing shows it all the same */ }
    this.changed();
  }

  reset() {
    this.change(structuredClone(this.first));
  }

  // Of strips or XY plots: another one at a place, none there, or one moved.
  replace(kind, at, value) {
    this.change({ [kind]: this[kind].map((one, k) => (k === at ? value : one)) });
  }

  remove(kind, at) {
    this.change({ [kind]: this[kind].filter((one, k) => k !== at) });
  }

  add(kind, value) {
    this.change({ [kind]: [...this[kind], value] });
  }

  move(kind, from, to) {
    if (to < 0 || to >= this[kind].length || from === to) return;
    const all = [...this[kind]];
    all.splice(to, 0, ...all.splice(from, 1));
    this.change({ [kind]: all });
  }
}

function read() {
  try {
    return JSON.parse(localStorage.getItem(KEY));
  } catch {
    return null;
  }
}

// A list of channels to choose from; `allowed` greys some.
export function options(channels, allowed = () => true) {
  const groups = Map.groupBy([...channels.values()], (channel) => channel.title);
  return [...groups].map(([title, some]) => {
    const group = Object.assign(document.createElement("optgroup"), { label: title });
    group.append(...some.map((channel) => Object.assign(document.createElement("option"), {
      value: channel.name,
      textContent: [title, channel.label === "measured" ? "" : ` ${channel.label}`,
        channel.unit ? `, ${channel.unit}` : ""].join(""),
      disabled: !allowed(channel),
    })));
    return group;
  });
}
