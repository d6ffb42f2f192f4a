// A tile for each axis of a bench that has several. A click shows the strips of that axis.

import { element, setText, shown } from "./style/plots.js";

export class Tiles {
  constructor(host, look) {
    Object.assign(this, { host, look });
    this.made = new Map();
  }

  show(tiles, looked) {
    this.host.hidden = !tiles.length;
    if (tiles.map((tile) => tile.axis).join() !== [...this.made.keys()].join()) this.build(tiles);
    for (const tile of tiles) {
      const { box, mode, values, trouble } = this.made.get(tile.axis);
      box.setAttribute("aria-current", tile.axis === looked);
      mode.dataset.mode = tile.mode;
      setText(mode, tile.mode || "–");
      setText(values, `${shown(tile.displacement_mm, 2)}\u00a0mm   X\u00a0${shown(tile.rtd_x_degC, 1)}   Y\u00a0${shown(tile.rtd_y_degC, 1)}\u00a0°C`);
      setText(trouble, tile.trouble || tile.running);
      trouble.classList.toggle("refused", Boolean(tile.trouble));
    }
  }

  build(tiles) {
    this.made = new Map(tiles.map(({ axis }) => {
      const mode = element("span", { className: "mode" });
      const values = element("span", { className: "values" });
      const trouble = element("span", { className: "small" });
      const box = element("button", { type: "button", title: `Show the strips of ${axis}` },
        element("span", {}, element("strong", { textContent: axis }), " ", mode), values, trouble);
      box.dataset.axis = axis;
      box.onclick = () => this.look(axis);
      return [axis, { box, mode, values, trouble }];
    }));
    this.host.replaceChildren(...[...this.made.values()].map(({ box }) => box));
  }
}
