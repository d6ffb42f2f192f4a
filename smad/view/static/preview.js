// What a command will ask for, drawn before it is given: the reference, and the limits at its edge.

import uPlot from "./style/vendor/uPlot.js";
import { around, limitLines } from "./plot.js";
import { axis, curve, element } from "./style/plots.js";

const HEIGHT = 110;

const sizes = new ResizeObserver((changed) => {
  for (const { target } of changed) target.plot.setSize({ width: target.clientWidth, height: HEIGHT });
});

export function drawPreviews(host, found, channel, limit) {
  for (const box of host.children) {
    sizes.unobserve(box);
    box.plot?.destroy();
  }
  host.replaceChildren();
  for (const one of found) {
    const words = element("p", { className: "small", textContent: `${one.title}: ${one.words}` });
    words.classList.toggle("refused", one.refused);
    const box = element("div", { className: "preview" }, words);
    host.append(box);
    if (one.t_s.length > 1 && one.mm.some((value) => value != null)) {
      box.plot = plotOf(box, one, channel, limit);
      sizes.observe(box);
    }
  }
}

function plotOf(box, one, channel, limit) {
  const made = new uPlot({
    width: Math.max(box.clientWidth, 100),
    height: HEIGHT,
    legend: { show: false },
    cursor: { show: false },
    scales: { x: { time: false }, y: { range: (plot, low, high) => around(low, high, channel.digits) } },
    axes: [axis({ size: 24, values: (plot, splits) => splits.map((s) => `${s} s`) }), axis({ size: 44, space: 20 })],
    series: [{}, curve("main")],
    hooks: { draw: [(plot) => limitLines(plot, "y", channel, limit)] },
  }, [one.t_s, one.mm], box);
  return made;
}
