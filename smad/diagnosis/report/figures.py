"""Figures of an answer: the signal with the largest gap, further signals, and laws as curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from sim_device.plant import Law
from smad.diagnosis.answer import Answer
from smad.diagnosis.places.place import BOTH, PlacesPlant, law_series, states_seen
from smad.diagnosis.plant import Array, ModelPoint
from smad.diagnosis.rivals.evidence import with_drifts
from smad.diagnosis.rivals.fit import replayed
from smad.diagnosis.rivals.left_out import stitched
from smad.diagnosis.rivals.parts import LawPart
from smad.diagnosis.rivals.search import Search
from smad.diagnosis.runs import GapRun
from smad.diagnosis.verdict import PAIRED, Cause
from smad.report.page import Picture
from smad.report.plots import draw, label, new_figure, picture
from smad.style.palette import in_print
from smad.units import in_words, labelled

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

_BINS = 24
_MORE_SIGNALS = 5
_DRIFTS = " Slow drifts and offsets that were fitted in the run are in the predictions."


@dataclass(frozen=True, kw_only=True, eq=False)
class Course:
    """The judged run with the largest gap; `measured`, `before` and `after` are (bins, channels).

    `before` is the simulator as configured, `after` with the causes, fitted without the run (None
    without a fit). Both include the fitted drifts of the run; `drifts` is what a caption says of
    these, empty without any. `floors` are (bins, channels) in `units`, `order` the channels by gap,
    `labels` those of their axes.
    """

    run: str
    t_s: Array
    measured: Array
    before: Array
    after: Array | None
    floors: Array
    order: tuple[int, ...]
    labels: tuple[str, ...]
    units: tuple[str, ...]
    paired: bool
    drifts: str

    @classmethod
    def of(cls, answer: Answer, search: Search) -> Course:
        """The judged run with the largest gap, of an answer and its search."""
        question, squares = search.question, search.configured.squares
        counts = np.maximum(question.judged.counts, 1.0)
        k = int(np.argmax((squares / counts).max(axis=1)))
        trial = question.judged.trials[k]
        run = question.judged.part([k])
        replay = replayed(run, question.model.start, question.model, exact=True)
        # It was replayed before, to be judged as configured.
        assert replay is not None
        fitted = search.final.fit
        predicted = None if fitted is None else question.predicted(fitted)
        paired, after = answer.verdict.gaps_of == PAIRED, None
        (before,) = replay if paired else with_drifts(run, replay)
        if predicted is not None:
            judged = question.judged
            judged_as = [replace(p, values=with_drifts(judged, p.values)) for p in predicted]
            after = stitched(judged, judged_as)[k]
        measured = np.where(trial.rows.valid, trial.target, np.nan)
        if paired:
            measured, before = measured - before, np.zeros_like(before)
            after = None if after is None else after - replay[0]
        channels = question.model.plant.channels
        ranked = np.argsort(-(squares / counts)[k], kind="stable")
        return cls(
            run=trial.played.whole.name,
            t_s=np.asarray((np.arange(len(before)) + 0.5) * trial.played.period_s),
            measured=measured,
            before=before,
            after=after,
            floors=trial.rows.sd,
            order=tuple(int(c) for c in ranked if trial.rows.valid[:, c].any()),
            labels=tuple(labelled(c.words or c.name, c.unit) for c in channels),
            units=tuple(c.unit for c in channels),
            paired=paired,
            drifts=_DRIFTS if run.has_drifts else "",
        )

    def curves(self, c: int) -> list[tuple[Array, str, str, str, float]]:
        """The curves of a channel: values, label, colour, style and width."""
        out = [(self.measured[:, c], "now − then" if self.paired else "measured", "main", "-", 3.2)]
        if not self.paired:
            out.append((self.before[:, c], "simulator as configured", "reference", "--", 1.2))
        if self.after is not None:
            words = "predicted by the cause" if self.paired else "simulator with the cause"
            out.append((self.after[:, c], words, "x", "-", 1.0))
        return out


def largest_gap(course: Course) -> Picture:
    """The signal with the largest gap: measured and simulated, and below what is left of it."""
    c = course.order[0]
    # Between two days there is only the difference.
    figure, axes = new_figure(
        1 if course.paired else 2,
        height_in=2.6 if course.paired else 4.4,
        share_x=True,
        width_in=7.0,
    )
    _draw(axes[0], course.t_s, course.curves(c))
    label(axes[0], "", "", course.labels[c], legend=False)
    lower = axes[-1]
    lower.fill_between(
        course.t_s,
        -course.floors[:, c],
        course.floors[:, c],
        linewidth=0.0,
        color=in_print("reference"),
        alpha=0.35,
        label="floor",
    )
    if not course.paired:
        measured, *simulated = course.curves(c)
        _draw(lower, course.t_s, [(measured[0] - y, "", *pen) for y, _, *pen in simulated])
    words = "" if course.paired else labelled("measured − simulated", course.units[c])
    label(lower, "time of the run, s", "", words, legend=False)
    _legend(figure)
    lead = "The change of the" if course.paired else "The"
    without = "" if course.after is None else " The cause was fitted without this run."
    caption = f"{lead} signal with the largest gap, in {course.run}.{without}{course.drifts}"
    return picture(figure, "The largest gap", caption)


def more_signals(course: Course) -> Picture | None:
    """The signals that are furthest off after that with the largest gap."""
    channels = course.order[1 : 1 + _MORE_SIGNALS]
    if not channels:
        return None
    figure, axes = new_figure(len(channels), height_in=1.5 * len(channels) + 0.4, share_x=True)
    for ax, c in zip(axes, channels, strict=True):
        _draw(ax, course.t_s, course.curves(c))
        label(ax, "", "", course.labels[c], legend=False)
    axes[-1].set_xlabel("time of the run, s")
    _legend(figure)
    caption = f"{course.run}: the next signals by their gap.{course.drifts}"
    return picture(figure, "More signals", caption)


def _legend(figure: Figure) -> None:
    """One legend below the axes: a noisy signal fills them."""
    curves: dict[str, Artist] = {}
    for ax in figure.axes:
        handles, words = ax.get_legend_handles_labels()
        curves |= dict(zip(words, handles, strict=True))
    figure.legend(
        list(curves.values()),
        list(curves),
        loc="outside lower left",
        ncols=4,
        frameon=False,
        fontsize=8,
    )


def _draw(ax, t_s: Array, curves) -> None:  # type: ignore[no-untyped-def]
    for values, words, colour, style, width in curves:
        draw(ax, t_s, values, words, colour, style=style, width=width)


def laws(answer: Answer, search: Search) -> list[Picture]:
    """The law of each cause that is one, over the state that it goes with most."""
    question, fitted = search.question, answer.stages[-1].fitted
    plant: PlacesPlant = question.model.plant
    runs = [p.run for p in question.evidence.played]
    out = []
    for cause, part, block in zip(
        answer.verdict.causes, fitted.model.parts, fitted.model.slices, strict=True
    ):
        if isinstance(part, LawPart) and cause.terms and cause.terms[0].state:
            of_sides = part.responses.law_of(part.columns, fitted.x[block])
            out.append(_law(plant, fitted.point, runs, of_sides, cause))
    return out


def _law(
    plant: PlacesPlant,
    point: ModelPoint,
    runs: Sequence[GapRun],
    of_sides: Sequence[Law],
    cause: Cause,
) -> Picture:
    figure, (top, low) = new_figure(2, height_in=3.6, share_x=True)
    state = cause.terms[0].state
    for law, colour in zip(of_sides, ("x", "y"), strict=False):
        x, y = _points(plant, point, runs, law, state)
        edges = np.linspace(x.min(), x.max(), _BINS + 1)
        in_bin = np.clip(np.digitize(x, edges) - 1, 0, _BINS - 1)
        count = np.bincount(in_bin, minlength=_BINS)
        mean = np.bincount(in_bin, y, minlength=_BINS) / np.maximum(count, 1)
        square = np.bincount(in_bin, y**2, minlength=_BINS) / np.maximum(count, 1)
        sd = np.sqrt(np.maximum(square - mean**2, 0.0))
        middle = np.where(count > 0, 0.5 * (edges[1:] + edges[:-1]), np.nan)
        side = "" if law.side == BOTH else f", spring {law.side.upper()}"
        top.plot(middle, mean, color=in_print(colour), label=f"law{side}")
        top.fill_between(
            middle, mean - sd, mean + sd, color=in_print(colour), alpha=0.2, linewidth=0.0
        )
        low.bar(
            middle,
            count / max(int(count.max()), 1),
            width=np.diff(edges),
            alpha=0.4,
            color=in_print(colour),
        )
    top.axhline(0.0, color=in_print("text"), linewidth=0.6)
    label(top, "", in_words(cause.unit) or "share", cause.words)
    low.set_ylim(0.0, 1.05)
    label(
        low, labelled(*plant.state_words(cause.place, state)), "", "how often the runs were there"
    )
    return picture(
        figure,
        f"Law at the {cause.words}",
        f"{cause.words}: the law over {cause.terms[0].words}. Line and band: its mean and standard "
        "deviation over the runs, where its other states vary. Below: where the runs were.",
    )


def _points(
    plant: PlacesPlant, point: ModelPoint, runs: Sequence[GapRun], law: Law, state: str
) -> tuple[Array, Array]:
    """Values of a state and of the law over all runs."""
    xs, ys = [], []
    for run in runs:
        states = plant.trajectory(point, run, fast=True)
        xs.append(states_seen(plant, law.place, law.side, states)[state])
        ys.append(law_series(plant, law, states, run.t_s))
    return np.concatenate(xs), np.concatenate(ys)
