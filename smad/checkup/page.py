"""A check-up as a page: the answer, the laws, its budget, and what differs where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.checkup.commission import Judged
from smad.checkup.paired.difference import Pair
from smad.checkup.verdict import QUIET, UNCALIBRATED, UNKNOWN, Share, Verdict
from smad.diagnosis.answer import place_shares
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.gap import change_of, with_effects
from smad.diagnosis.places.place import Forceable
from smad.diagnosis.plant import Array
from smad.diagnosis.report import figures
from smad.diagnosis.report.page import answer_table
from smad.diagnosis.search.locate import Located
from smad.report.page import Block, Page, Picture, Section, Table, Text
from smad.style.palette import in_print

_SHOWN = 4
_DIGITS = 3


def checkup_page(found: Judged, facts: Sequence[tuple[str, str]]) -> Page:
    """The page; `facts` are baseline, folder and the like."""
    v = found.verdict
    answer: list[Block] = [answer_table(v.places)] if v.places else []
    if v.likely and not v.places:
        answer.append(_likely(v))
    answer += [Text(note, "note") for note in v.notes]
    if v.outcome not in (QUIET, UNKNOWN) and not v.places:
        answer.append(Text(UNCALIBRATED[0].upper() + UNCALIBRATED[1:] + ".", "note"))
    sections = [Section("Answer", answer or [Text(_NOTHING)])]
    if found.located is not None and v.places:
        sections.append(Section("Law", _laws(found, found.located)))
        sections.append(Section("Places", [_map(found, found.located)]))
    sections += [
        Section("Budget", [Picture(_budget_figure(v), _BUDGET), _budget(v)]),
        Section("Runs", [_differences(found)]),
    ]
    return Page(
        "Check-up", sections, lead=v.headline[0].upper() + v.headline[1:] + ".", facts=facts
    )


_NOTHING = "Nothing stands out of what two good days differ in."
_BUDGET = (
    "RMS of now minus then in floors: as measured, less what days and small moves of parameters "
    "explain, and less what the model makes of each run with laws that it had no part in. A bench "
    "without a change stays at 1 or below."
)


def _laws(found: Judged, located: Located) -> list[Block]:
    plant = found.pairs.plant
    assert isinstance(plant, Forceable)
    runs = [p.reference.played.run for p in found.pairs.pairs]
    return figures.laws(plant, found.pairs.point, runs, found.verdict.places, located.laws)


def _map(found: Judged, located: Located) -> Picture:
    plant = found.pairs.plant
    assert isinstance(plant, Forceable)
    return figures.places_map(place_shares(plant, located.where.ranked))


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
    header = ("signal", "unit", "now − then", "less days", _last(v), "floor")
    rows = [
        (s.signal, s.unit, *(f"{x:.{_DIGITS}g}" for x in (s.raw, s.parameters, _left(v, s),
                                                          s.noise)))
        for s in (*v.budget, v.whole)
    ]  # fmt: skip
    return Table(header, rows, numeric=frozenset(range(2, 6)))


def _last(v: Verdict) -> str:
    return "less law" if v.places else "less named"


def _left(v: Verdict, s: Share) -> float:
    return s.laws if v.places else s.entries


def _budget_figure(v: Verdict) -> str:
    stages = (
        ("as measured", [s.raw for s in v.budget]),
        ("less days", [s.parameters for s in v.budget]),
        (_last(v), [_left(v, s) for s in v.budget]),
    )
    return figures.budget([s.signal for s in v.budget], [s.noise for s in v.budget], stages)


def _differences(found: Judged) -> Picture:
    """Signals of the run with most of the change, what the model makes of it beside."""
    from smad.report.plots import draw, label, new_figure, svg_of

    pairs, v = found.pairs, found.verdict
    k = next(k for k, p in enumerate(pairs.pairs) if p.now == v.worst_run)
    pair = pairs.pairs[k]
    said, name = _said(found, k)
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
            draw(ax, t, said[:, c], name, "x", style="--")
        label(ax, "", channel.name, legend=c == order[0])
    axes[-1].set_xlabel("time of the run, s")
    caption = f"{v.worst_run}: the signals that differ most, with what the model makes of it."
    return Picture(svg_of(figure, "Differences"), caption)


def _said(found: Judged, k: int) -> tuple[Array | None, str]:
    """What the model makes of a pair: with laws that it had no part in, else named entries."""
    v = found.verdict
    if found.located is not None and found.located.laws and v.places:
        return found.located.change[k], "law, fitted without this run"
    values = v.likely[0].values if v.likely else {}
    change = change_of(found.pairs, with_effects(found.pairs.point, values)) if values else None
    return (None, "") if change is None else (change[k], " + ".join(v.likely[0].names))


def _largest(pair: Pair) -> list[int]:
    scaled = np.where(pair.rows.valid, pair.difference / pair.rows.sd, 0.0)
    return [int(c) for c in np.argsort(-(scaled**2).mean(axis=0))]
