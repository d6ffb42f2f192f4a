// What the plots of the live page share beside those of all pages (`style/plots.js`).

import { clipped, css, decimals, element, line } from "./style/plots.js";

export const button = (textContent, title, onclick) =>
  element("button", { type: "button", textContent, title, ariaLabel: /\w/.test(textContent) ? null : title, onclick });

// What an axis shows: the data with some room, and never so little that noise fills it.
export function around(low, high, digits) {
  if (low == null || high == null) return [0, 1];
  const least = 20 * 10 ** -digits;
  const half = Math.max(1.12 * (high - low), least) / 2;
  const middle = (low + high) / 2;
  return [middle - half, middle + half];
}

export function time(seconds, digits = 0) {
  const two = (number) => String(number).padStart(2, "0");
  const at = new Date(Math.round(seconds * 1000));
  const whole = [at.getHours(), at.getMinutes(), at.getSeconds()].map(two).join(":");
  return digits ? `${whole}.${String(at.getMilliseconds()).padStart(3, "0").slice(0, digits)}` : whole;
}

// The date before a time of another day than today, or of any.
export function day(seconds, any = false) {
  const date = (at) => [at.getFullYear(), at.getMonth() + 1, at.getDate()].map((n) => String(n).padStart(2, "0")).join("-");
  const then = date(new Date(seconds * 1000));
  return any || then !== date(new Date()) ? `${then} ` : "";
}

export const clock = (plot, splits, index, space, step) =>
  splits.map((s) => time(s, Math.min(3, decimals(step))));

// A limit is a dashed line; one beyond the axis is an arrow at its edge, and the data keep the height.
// How far away it is stands in the heading, where it covers no trace.
export function limitLines(plot, scale, channel, limit) {
  clipped(plot, (ctx, bbox) => {
    ctx.strokeStyle = ctx.fillStyle = css("--limit");
    ctx.setLineDash([8 * devicePixelRatio, 4 * devicePixelRatio]);
    const { min, max } = plot.scales[scale];
    for (const value of channel.both_ways ? [limit, -limit] : [limit]) {
      if (value >= min && value <= max) {
        const y = plot.valToPos(value, scale, true);
        line(ctx, bbox.left, y, bbox.left + bbox.width, y);
      } else {
        const above = value > max;
        const px = devicePixelRatio;
        ctx.textAlign = "right";
        ctx.textBaseline = above ? "top" : "bottom";
        ctx.fillText(above ? "▲" : "▼",
          bbox.left + bbox.width - 2 * px, above ? bbox.top + px : bbox.top + bbox.height);
      }
    }
  });
}
