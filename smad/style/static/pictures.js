// The drawn pictures of a page of one file: each can be saved as it is on paper.

import { element } from "./plots.js";
import { pngOf, save } from "./sheet.js";

const TITLE = /[^\w.-]+/g;

for (const [n, svg] of [...document.querySelectorAll("figure:not(.panels) > svg")].entries()) {
  const name = `${document.title} ${n + 1}`.replace(TITLE, "-");
  // By itself it has the colours of print, which stand behind those of the page.
  const text = () => new XMLSerializer().serializeToString(svg).replace(/var\(--[\w-]+, (#\w+)\)/g, "$1");
  const button = (kind, blobOf) => {
    const one = element("button", { type: "button", textContent: kind, title: `Save this figure as ${kind}` });
    one.dataset.save = kind.toLowerCase();
    one.onclick = async () => save(await blobOf(), `${name}.${kind.toLowerCase()}`);
    return one;
  };
  const { width, height } = svg.viewBox.baseVal;
  svg.after(element("span", { className: "save" }, "Save ",
    button("SVG", () => new Blob([text()], { type: "image/svg+xml" })),
    button("PNG", () => pngOf(text(), width, height))));
}
