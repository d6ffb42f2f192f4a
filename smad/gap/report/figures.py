"""The figures of a diagnosis, each as SVG text, from its records alone."""

from __future__ import annotations

from itertools import islice

import numpy as np

from smad.gap.records import HALF_CHI2_95, Diagnosis, Trace
from smad.report import panels
from smad.report.panels import Panel, Panels, digits_for
from smad.report.plots import label, new_figure, svg_of
from smad.style.palette import in_print

_MOST_OVERLAYS = 5


def waterfall(d: Diagnosis) -> str:
    """Bars raw, refit and each effect, for the open loop and the local views."""
    figure, axes = new_figure(1, 2, width_in=8.0, height_in=2.8)
    names = ["raw", "refit", *("+ " + "\n+ ".join(step) for step in d.steps)]
    for ax, view in zip(axes, ("open loop", "local"), strict=True):
        total = next((r for r in d.waterfall if r.view == view and not r.output), None)
        if total is None:
            continue
        values = [total.raw, total.refit, *total.effects]
        pens = ["reference", "run-2", *["main"] * len(total.effects)]
        at = range(len(values))
        ax.bar(at, values, color=[in_print(pen) for pen in pens], width=0.6)
        for x, y in enumerate(values):
            ax.annotate(f"{y:.1f}×", (x, y), ha="center", va="bottom", fontsize=8)
        ax.set_xticks(at, names[: len(values)])
        ax.set_ylim(0, 1.18 * max([*values, 0.5]))
        label(ax, "", "gap over the floor", view, legend=False)
    return svg_of(figure, "Gap as configured, after the refit, and after each effect")


def heat_map(d: Diagnosis) -> str:
    """Excess by place and regime, after the refit and with the best model."""
    rows = list(dict.fromkeys((c.sub_model, c.side) for c in d.heat))
    regimes = list(dict.fromkeys(c.regime for c in d.heat))
    grids = np.full((2, len(rows), len(regimes)), np.nan)
    for c in d.heat:
        place = rows.index((c.sub_model, c.side)), regimes.index(c.regime)
        grids[:, *place] = c.refit, c.final
    top = max(1.0, float(np.nanmax(grids[0])))
    figure, axes = new_figure(1, 2, width_in=9.0, height_in=1.3 + 0.36 * len(rows))
    titles = ("after the refit", "with the best model")
    for ax, grid, title in zip(axes, grids, titles, strict=True):
        ax.imshow(np.sqrt(grid), cmap="YlOrRd", vmin=0, vmax=top**0.5, aspect="auto")
        ax.set_xticks(range(len(regimes)), regimes, rotation=40, ha="right")
        ax.set_yticks(range(len(rows)), [f"{m} {s}".strip() for m, s in rows])
        ax.grid(visible=False)
        ax.set_title(title, fontsize=10, loc="left")
        for (i, j), value in np.ndenumerate(grid):
            if np.isfinite(value):
                shade = "#ffffff" if value > 0.55 * top else "#1b1f24"
                ax.text(j, i, f"{value:.1f}", ha="center", va="center", fontsize=7, color=shade)
    return svg_of(figure, "Excess error by sub-model, side and regime")


def overlays(d: Diagnosis) -> list[Panels]:
    """Measured, refitted and final course of the signals with the largest gap, and what is left."""
    first: dict[str, Trace] = {}
    for trace in d.traces:
        first.setdefault(trace.channel, trace)
    return [_overlay(t, bool(d.verdict.effects)) for t in islice(first.values(), _MOST_OVERLAYS)]


def _overlay(trace: Trace, with_effect: bool) -> Panels:
    t_s, measured = np.array(trace.t_s), np.array(trace.measured)
    digits, unit = digits_for(measured), trace.unit.replace("degC", "°C")
    simulated = [("simulated, refitted", np.array(trace.refit), "run-2")]
    if with_effect:
        simulated.append(("simulated, with the effect", np.array(trace.final), "main"))
    signal = [panels.Trace(name, t_s, y, pen) for name, y, pen in simulated]
    rest = [panels.Trace(name, t_s, measured - y, pen) for name, y, pen in simulated]
    signal.append(panels.Trace("measured", t_s, measured, "text"))
    return Panels(
        [
            Panel(trace.channel, unit, digits, signal),
            Panel("Residual", unit, digits + 1, rest),
        ],
        caption=f"{trace.channel}, run {trace.run}",
    )


def profiles(d: Diagnosis) -> str:
    """Profile of each parameter of the effects."""
    values = [v for v in d.values if len(v.profile) > 1]
    columns = min(3, len(values))
    rows = -(-len(values) // columns)
    figure, axes = new_figure(rows, columns, width_in=2.7 * columns + 0.6, height_in=2.3 * rows)
    for ax, v in zip(axes, values, strict=False):
        x, y = zip(*v.profile, strict=True)
        ax.plot(x, y, "o-", color=in_print("main"), markersize=3)
        ax.axhline(HALF_CHI2_95, color=in_print("reference"), linestyle="--", linewidth=0.9)
        ax.axvspan(v.low, v.high, color=in_print("main"), alpha=0.12, linewidth=0)
        ax.set_ylim(0, min(max(y) * 1.1 + 0.1, 12.0))
        ax.margins(x=0.05)
        ax.locator_params(axis="x", nbins=4)
        label(ax, f"{v.name} in {v.unit}", "rise of −log L", v.effect, legend=False)
    for ax in axes[len(values) :]:
        ax.set_visible(False)
    return svg_of(figure, "Profiles of the effects' parameters")
