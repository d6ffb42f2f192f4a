// What all plots share, of the live page and of the pages of one file: colours, numbers as text, axes,
// lines, and marks in time. Names and texts go in as text, never as markup.

const FONT = "12px system-ui, sans-serif";
const MARK_FONT_PX = 11;
const FAR = 400; // points between two samples of one run, where others lie in between

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export const shown = (value, digits) => (value == null ? "–"
  : value.toFixed(digits).replace(/^-(?=0\.?0*$)/, "").replace("-", "−"));

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

// How many digits tell numbers apart that are steps of `step`.
export function decimals(step) {
  for (let digits = 0; digits < 12; digits += 1) {
    const whole = step * 10 ** digits;
    if (whole > 0.5 && Math.abs(whole - Math.round(whole)) < 1e-6) return digits;
  }
  return 12;
}

// An axis that follows the page's colours, its numbers written as everywhere on the page and not as the
// browser's language has them; `more` is what else uPlot is to know of it, such as its size.
export function axis(more = {}) {
  const lines = { stroke: () => css("--line"), width: 1 };
  return { stroke: () => css("--quiet"), font: FONT, grid: lines, ticks: lines,
    labelSize: 20, labelGap: 2, labelFont: FONT,
    values: (plot, splits, index, space, step) => splits.map((value) => shown(value, decimals(step))), ...more };
}

// A line of a plot in one of the palette's colours; `dash` are lengths of line and gap.
export function curve(pen, dash = []) {
  return { stroke: () => css(`--${pen}`), width: 1.5, dash: dash.length ? dash : undefined,
    points: { show: false }, spanGaps: false };
}

// Calls `draw(ctx, bbox)` with the canvas clipped to the plot's area.
export function clipped(plot, draw) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.lineWidth = devicePixelRatio;
  ctx.font = `${MARK_FONT_PX * devicePixelRatio}px system-ui, sans-serif`;
  draw(ctx, bbox);
  ctx.restore();
}

export function line(ctx, x0, y0, x1, y1) {
  ctx.beginPath();
  ctx.moveTo(x0, y0);
  ctx.lineTo(x1, y1);
  ctx.stroke();
}

// A line over the whole height at each mark's `x`; with `texts` its text beside it, where it has room.
export function drawMarks(plot, marks, texts) {
  clipped(plot, (ctx, bbox) => {
    ctx.strokeStyle = ctx.fillStyle = css("--quiet");
    ctx.setLineDash([2 * devicePixelRatio, 3 * devicePixelRatio]);
    [ctx.textAlign, ctx.textBaseline] = ["left", "alphabetic"];
    let free = -Infinity;
    for (const { x, text } of marks) {
      const at = plot.valToPos(x, "x", true);
      line(ctx, at, bbox.top, at, bbox.top + bbox.height);
      // A text that would lie on the one before is left to the list of events.
      const width = ctx.measureText(text).width;
      const start = Math.min(at + 4 * devicePixelRatio, bbox.left + bbox.width - width);
      if (!texts || start < free || at < bbox.left) continue;
      ctx.fillText(text, start, bbox.top + 12 * devicePixelRatio);
      free = start + width;
    }
  });
}

// The place in increasing `xs` that is closest to `x`.
export function closest(xs, x) {
  let [low, high] = [0, xs.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (xs[middle] <= x) low = middle;
    else high = middle;
  }
  return x - xs[low] <= xs[high] - x ? low : high;
}

// The place nearest to `at` where there is a value; samples of several runs lie between each other.
export function nearest(values, at) {
  if (values[at] !== undefined) return at;
  for (let step = 1; step < FAR; step += 1) {
    if (values[at - step] !== undefined) return at - step;
    if (values[at + step] !== undefined) return at + step;
  }
  return at;
}

// Calls `redraw` when the screen turns dark or light.
export function onScheme(redraw) {
  const dark = matchMedia("(prefers-color-scheme: dark)");
  dark.addEventListener("change", redraw);
  return () => dark.removeEventListener("change", redraw);
}
