"""Figures of a verdict as SVG: the law over its state, the map of places, the budget."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from sim_device.plant.laws import Law
from smad.diagnosis.numerics.folds import Array
from smad.diagnosis.places.place import PlacesPlant, single_sides
from smad.diagnosis.places.responses import law_series
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import PlaceShare, PlaceTold
from smad.report.page import Block, Picture, Text
from smad.style.palette import in_print

_BINS = 24
_PLACES_SHOWN = 12


def laws(
    plant: PlacesPlant,
    point: ModelPoint,
    runs: Sequence[GapRun],
    places: Sequence[PlaceTold],
    found: Sequence[Law],
) -> list[Block]:
    """The law of each place over the state that it goes with most; `runs` as they are replayed."""
    out: list[Block] = []
    for told in places:
        own = [law for law in found if law.place == told.place]
        state = told.terms[0].state if told.terms else ""
        if not own or not state:
            continue
        words, unit = plant.state_words(told.place, state)
        out.append(
            Picture(
                _law(plant, point, runs, own, told, label=f"{words}, {unit}"),
                f"{told.words}: the law over {told.terms[0].words}. The line is its mean, the "
                "band one standard deviation of it within the runs, where other states differ; "
                "below, how often the runs were there. Beyond its ends the law keeps its last "
                "value.",
            )
        )
    return out or [Text("No law that brings the simulator nearer goes with a state.")]


def _law(
    plant: PlacesPlant,
    point: ModelPoint,
    runs: Sequence[GapRun],
    found: Sequence[Law],
    told: PlaceTold,
    *,
    label: str,
) -> str:
    from smad.report.plots import new_figure, svg_of

    figure, (top, low) = new_figure(2, height_in=3.6, share_x=True)
    for law, colour in zip(found, ("x", "y"), strict=False):
        x, y = _points(plant, point, runs, law, told.terms[0].state)
        edges = np.linspace(x.min(), x.max(), _BINS + 1)
        at = np.clip(np.digitize(x, edges) - 1, 0, _BINS - 1)
        count = np.bincount(at, minlength=_BINS)
        mean = np.bincount(at, y, minlength=_BINS) / np.maximum(count, 1)
        square = np.bincount(at, y**2, minlength=_BINS) / np.maximum(count, 1)
        sd = np.sqrt(np.maximum(square - mean**2, 0.0))
        middle = np.where(count > 0, 0.5 * (edges[1:] + edges[:-1]), np.nan)
        side = "" if law.side == "both" else f" {law.side.upper()}"
        top.plot(middle, mean, color=in_print(colour), label=f"law{side}")
        top.fill_between(middle, mean - sd, mean + sd, color=in_print(colour), alpha=0.2,
                         linewidth=0.0)  # fmt: skip
        low.bar(middle, count / max(int(count.max()), 1), width=np.diff(edges), alpha=0.4,
                color=in_print(colour))  # fmt: skip
    top.axhline(0.0, color=in_print("text"), linewidth=0.6)
    top.set_ylabel(told.unit if told.unit != "1" else "share")
    top.legend(loc="best")
    low.set_ylabel("data")
    low.set_ylim(0.0, 1.05)
    low.set_xlabel(label)
    return svg_of(figure, f"Law: {told.words}")


def _points(
    plant: PlacesPlant, point: ModelPoint, runs: Sequence[GapRun], law: Law, state: str
) -> tuple[Array, Array]:
    """Values of a state and of the law over all runs."""
    place = next(p for p in plant.places if p.name == law.place)
    (side, *_) = single_sides(place, law.side)
    xs, ys = [], []
    for run in runs:
        states = plant.trajectory(point, run, fast=True)
        xs.append(plant.seen(law.place, side, states)[state])
        ys.append(law_series(plant, law, states, run.t_s))
    return np.concatenate(xs), np.concatenate(ys)


@dataclass(frozen=True)
class Curve:
    """Values of all channels over a run, (bins, channels), and how they are drawn."""

    values: Array
    label: str
    pen: str
    style: str = "-"


def courses(
    title: str,
    caption: str,
    *,
    period_s: float,
    shown: Mapping[int, str],
    curves: Sequence[Curve],
    band: Array | None = None,
) -> Picture:
    """Some channels over a run, each by its number and label; `band` is their floor around 0."""
    from smad.report.plots import draw, label, new_figure, svg_of

    figure, axes = new_figure(len(shown), height_in=1.5 * len(shown) + 0.4, share_x=True)
    t = (np.arange(len(curves[0].values)) + 0.5) * period_s
    for ax, (c, name) in zip(axes, shown.items(), strict=True):
        if band is not None:
            ax.fill_between(t, -band[:, c], band[:, c], color=in_print("reference"), alpha=0.25,
                            linewidth=0.0, label="floor")  # fmt: skip
        for curve in curves:
            draw(ax, t, curve.values[:, c], curve.label, curve.pen, style=curve.style)
        label(ax, "", name, legend=c == next(iter(shown)))
    axes[-1].set_xlabel("time of the run, s")
    return Picture(svg_of(figure, title), caption)


def places_map(shares: Sequence[PlaceShare]) -> Picture:
    """What each place alone takes of runs left out, the best of its sides."""
    from smad.report.plots import new_figure, svg_of

    shown = shares[:_PLACES_SHOWN]
    figure, (ax,) = new_figure(height_in=0.26 * len(shown) + 0.7)
    at = np.arange(len(shown))
    ax.barh(at, [s.share for s in shown], 0.6, color=in_print("main"))
    ax.set_yticks(at, [s.words for s in shown])
    ax.invert_yaxis()
    ax.set_xlim(left=0.0)
    ax.set_xlabel("share that a law of this place takes, on runs left out")
    return Picture(
        svg_of(figure, "Places"),
        "Each place alone, by a law. Probabilities count every channel, and effects as well.",
    )


def budget(
    signals: Sequence[str], floors: Sequence[float], stages: Sequence[tuple[str, Sequence[float]]]
) -> str:
    """Bars of each signal in floors, one for each stage (name, values in the signal's unit)."""
    from smad.report.plots import new_figure, svg_of

    figure, (ax,) = new_figure(height_in=0.4 * len(signals) + 0.9)
    at = np.arange(len(signals))
    width = 0.8 / max(len(stages), 1)
    for k, ((name, values), colour) in enumerate(zip(stages, ("reference", "main", "y"),
                                                     strict=False)):  # fmt: skip
        shown = [x / f if f > 0.0 else 0.0 for x, f in zip(values, floors, strict=True)]
        ax.barh(at + width * (k - 0.5 * (len(stages) - 1)), shown, 0.9 * width, label=name,
                color=in_print(colour))  # fmt: skip
    ax.axvline(1.0, color=in_print("text"), linewidth=0.8)
    ax.set_yticks(at, signals)
    ax.invert_yaxis()
    ax.set_xlim(left=0.0)
    ax.set_xlabel("floors")
    ax.legend(loc="lower right")
    return svg_of(figure, "Budget by signal")
