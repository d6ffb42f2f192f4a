"""A check-up as a page: the answer, the laws, its budget, and what differs where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.checkup.judge import Judged
from smad.diagnosis.data.grid import PERIOD_S
from smad.diagnosis.report import figures
from smad.diagnosis.report.page import answer_table, budget, parameters, unseen
from smad.diagnosis.verdict import PLACES
from smad.report.page import Block, Page, Picture, Section, Text

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
    if v.parameters:
        sections.append(Section("Parameters", [parameters(v)]))
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
    pairs, v = judged.pairs, judged.verdict
    k = int(np.argmax([r.raw for r in v.by_run]))
    pair, rows = pairs.pairs[k], pairs.pairs[k].rows
    curves = [figures.Curve(np.where(rows.valid, pair.difference, np.nan), "now − then", "main")]
    if v.outcome == PLACES and judged.located.changes:
        said = judged.located.changes[-1][k]
        curves.append(figures.Curve(said, "what is told, fitted without this run", "x", "--"))
    scaled = np.where(rows.valid, pair.difference / rows.sd, 0.0)
    order = np.argsort(-(scaled**2).mean(axis=0))[:_SHOWN]
    shown = {int(c): pairs.plant.channels[c].name for c in order}
    caption = f"{v.by_run[k].run}: the signals that differ most, with what the model makes of it."
    return figures.courses(
        "Differences", caption, period_s=PERIOD_S, shown=shown, curves=curves, band=rows.sd
    )
