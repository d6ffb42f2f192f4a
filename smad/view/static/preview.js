// What a command will ask for, drawn before it is given: the reference, and the limits at its edge.

import uPlot from "./style/vendor/uPlot.js";
import { around, limitLines } from "./plot.js";
import { axis, curve, element, onScheme } from "./style/plots.js";

const HEIGHT = 110;

const sizes = new ResizeObserver((changed) => {
  for (const { target } of changed) target.plot.setSize({ width: target.clientWidth, height: HEIGHT });
});

onScheme(() => document.querySelectorAll(".preview").forEach((box) => box.plot?.redraw()));

export function drawPreviews(host, previews, channel, limit) {
  for (const box of host.children) {
    sizes.unobserve(box);
    box.plot?.destroy();
  }
  host.replaceChildren();
  for (const preview of previews) {
    const words = element("p", { className: "small", textContent: `${preview.title}: ${preview.words}` });
    words.classList.toggle("refused", preview.refused);
    const box = element("div", { className: "preview" }, words);
    host.append(box);
    if (preview.t_s.length > 1 && preview.mm.some((value) => value != null)) {
      box.plot = plotOf(box, preview, channel, limit);
      sizes.observe(box);
    }
  }
}

function plotOf(box, preview, channel, limit) {
  const made = new uPlot({
    width: Math.max(box.clientWidth, 100),
    height: HEIGHT,
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false }, y: { range: (plot, low, high) => around(low, high, channel.digits) } },
    axes: [axis({ size: 24, values: (plot, splits) => splits.map((s) => `${s} s`) }), axis({ size: 44, space: 20 })],
    series: [{}, curve("main")],
    hooks: { draw: [(plot) => limitLines(plot, "y", channel, limit)] },
  }, [preview.t_s, preview.mm], box);
  return made;
}
