"""A check-up as a page: the answer, the laws, its budget, and what differs where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.checkup.judge import Judged
from smad.checkup.paired.difference import Pair
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.report import figures
from smad.diagnosis.report.page import answer_table, budget, unseen
from smad.diagnosis.verdict import PLACES
from smad.report.page import Block, Page, Picture, Section, Text
from smad.style.palette import in_print

_SHOWN = 4
_NOTHING = "Nothing is told beyond the line above."


def checkup_page(judged: Judged, facts: Sequence[tuple[str, str]]) -> Page:
    """The page; `facts` are baseline, folder and the like."""
    v = judged.verdict
    answer: list[Block] = [answer_table(v.places)] if v.places else []
    answer += [Text(note, "note") for note in v.notes]
    sections = [Section("Answer", answer or [Text(_NOTHING)])]
    if v.outcome == PLACES:
        plant, point = judged.pairs.plant, judged.pairs.point
        runs = [p.reference.played.run for p in judged.pairs.pairs]
        laws = figures.laws(plant, point, runs, v.places, judged.located.laws)
        sections.append(Section("Law", laws))
    sections += [
        Section("Places", [figures.places_map(v.ranked)]),
        Section("Budget", budget(v)),
        Section("Runs", [_differences(judged)]),
        Section("What these runs would not have shown", [unseen(v)]),
    ]
    known = [("plant", f"{v.plant} {v.plant_version}"), ("smad", v.smad_version), *facts]
    return Page("Check-up", sections, lead=v.headline[0].upper() + v.headline[1:] + ".",
                facts=known)  # fmt: skip


def _differences(judged: Judged) -> Picture:
    """Signals of the run with most of the change, what the model makes of it beside."""
    from smad.report.plots import draw, label, new_figure, svg_of

    pairs, v = judged.pairs, judged.verdict
    k = int(np.argmax([r.raw for r in v.by_run]))
    pair, worst = pairs.pairs[k], v.by_run[k].run
    changes = judged.located.changes if v.outcome == PLACES else ()
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
        if changes:
            said = "what is told, fitted without this run"
            draw(ax, t, changes[-1][k][:, c], said, "x", style="--")
        label(ax, "", channel.name, legend=c == order[0])
    axes[-1].set_xlabel("time of the run, s")
    caption = f"{worst}: the signals that differ most, with what the model makes of it."
    return Picture(svg_of(figure, "Differences"), caption)


def _largest(pair: Pair) -> list[int]:
    scaled = np.where(pair.rows.valid, pair.difference / pair.rows.sd, 0.0)
    return [int(c) for c in np.argsort(-(scaled**2).mean(axis=0))]
