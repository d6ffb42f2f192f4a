"""A check-up as a page: the answer, its budget, and what differs where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.gap.paired.difference import Pair, Paired
from smad.gap.paired.rows import PERIOD_S
from smad.gap.paired.verdict import QUIET, UNCALIBRATED, Share, Verdict
from smad.report.page import Block, Page, Picture, Section, Table, Text
from smad.style.palette import in_print

_SHOWN = 4
_DIGITS = 3


def checkup_page(pairs: Paired, verdict: Verdict, facts: Sequence[tuple[str, str]]) -> Page:
    """The page; `facts` are baseline, folder and the like."""
    v = verdict
    answer: list[Block] = [_likely(v)] if v.likely else []
    answer += [Text(note, "note") for note in v.notes]
    if v.outcome != QUIET:
        answer.append(Text(UNCALIBRATED[0].upper() + UNCALIBRATED[1:] + ".", "note"))
    sections = [
        Section("Answer", answer or [Text("Nothing stands out of what two good days differ in.")]),
        Section("Budget", [Picture(_budget_figure(v), _BUDGET), _budget(v)]),
        Section("Where", [_differences(pairs, v)]),
    ]
    return Page(
        "Check-up", sections, lead=v.headline[0].upper() + v.headline[1:] + ".", facts=facts
    )


_BUDGET = (
    "RMS of now minus then in floors: as measured, less what days and small moves of parameters "
    "explain, and less the named entries. A bench without a change stays at 1 or below."
)


def _likely(v: Verdict) -> Table:
    rows = [
        (
            " + ".join(x.names),
            f"{x.probability:.2f}",
            "; ".join(f"{q} = {n:.3g}" for own in x.values.values() for q, n in own.items()),
        )
        for x in v.likely
        if x.probability >= 0.005
    ]
    return Table(("what may be the matter", "probability", "at"), rows, numeric=frozenset((1,)))


def _budget(v: Verdict) -> Table:
    header = ("signal", "unit", "now − then", "less days", "less named", "floor")
    rows = [
        (s.signal, s.unit, *(f"{x:.{_DIGITS}g}" for x in (s.raw, s.parameters, s.entries, s.noise)))
        for s in (*v.budget, v.whole)
    ]
    return Table(header, rows, numeric=frozenset(range(2, 6)))


def _budget_figure(v: Verdict) -> str:
    from smad.report.plots import new_figure, svg_of

    figure, (ax,) = new_figure(height_in=0.35 * len(v.budget) + 0.9)
    at = np.arange(len(v.budget))
    stages = (
        ("as measured", "reference", [s.raw for s in v.budget]),
        ("less days", "main", [s.parameters for s in v.budget]),
        ("less named entries", "y", [s.entries for s in v.budget]),
    )
    for k, (name, colour, rms) in enumerate(stages):
        values = [_in_floors(s, x) for s, x in zip(v.budget, rms, strict=True)]
        ax.barh(at + 0.27 * (k - 1), values, 0.25, label=name, color=in_print(colour))
    ax.axvline(1.0, color=in_print("text"), linewidth=0.8)
    ax.set_yticks(at, [s.signal for s in v.budget])
    ax.invert_yaxis()
    ax.set_xscale("log")
    ax.set_xlabel("floors")
    ax.legend(loc="lower right")
    return svg_of(figure, "Budget by signal")


def _in_floors(s: Share, value: float) -> float:
    return max(value / s.noise, 1e-2) if s.noise > 0.0 else 1e-2


def _differences(pairs: Paired, v: Verdict) -> Picture:
    """Signals of the run with most of the change, the named entries beside what differs."""
    from smad.report.plots import draw, label, new_figure, svg_of

    pair = next(p for p in pairs.pairs if p.now == v.worst_run)
    values = v.likely[0].values if v.likely else {}
    change = pairs.change(values) if values else None
    said = None if change is None else change[pairs.pairs.index(pair)]
    order = _largest(pair)[:_SHOWN]
    figure, axes = new_figure(len(order), height_in=1.5 * len(order) + 0.4, share_x=True)
    t = (np.arange(len(pair.difference)) + 0.5) * PERIOD_S
    for ax, c in zip(axes, order, strict=True):
        channel = pairs.plant.channels[c]
        floor = pair.rows.sd[:, c]
        ax.fill_between(t, -floor, floor, color=in_print("reference"), alpha=0.25, linewidth=0.0,
                        label="floor")  # fmt: skip
        measured = np.where(pair.rows.valid[:, c], pair.difference[:, c], np.nan)
        draw(ax, t, measured, "now − then", "main")
        if said is not None:
            draw(ax, t, said[:, c], " + ".join(v.likely[0].names), "x", style="--")
        label(ax, "", channel.name, legend=c == order[0])
    axes[-1].set_xlabel("time of the run, s")
    caption = f"{v.worst_run}: the signals that differ most, with what the named entries change."
    return Picture(svg_of(figure, "Differences"), caption)


def _largest(pair: Pair) -> list[int]:
    scaled = np.where(pair.rows.valid, pair.difference / pair.rows.sd, 0.0)
    return [int(c) for c in np.argsort(-(scaled**2).mean(axis=0))]
