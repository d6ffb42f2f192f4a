"""A diagnosis as one HTML page: the answer, the laws, the places, the budget, the runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smad.diagnosis.answer import Answer
from smad.diagnosis.data.played import predictions
from smad.diagnosis.report import figures
from smad.diagnosis.report.words import advice, budget_stages, name_words, repeated_lines
from smad.diagnosis.verdict import REFUSED, PlaceTold, Verdict
from smad.report.page import Block, Code, Page, Picture, Section, Table, Text

_SIGNALS = 5


def page_of(answer: Answer, asked: str = "", facts: Sequence[tuple[str, str]] = ()) -> Page:
    """The page. `asked` are the arguments as a shell takes them, `facts` files and the like."""
    v = answer.verdict
    sections = [Section("Answer", _answer(v), "answer")]
    if answer.listed is not None:
        laws = _laws(answer)
        sections += [
            *([Section("Laws", laws, "laws")] if laws else []),
            Section("Places", [figures.places_map(v.ranked)], "places"),
            Section("Budget", budget(v), "budget"),
            Section("Measured and simulated", [_course(answer)], "course"),
            Section("Parameters", [parameters(v)], "parameters"),
            Section("What these runs would not have shown", [unseen(v)], "unseen"),
        ]
    sections.append(Section("Runs", _runs(v), "runs"))
    steps = [f"{c}    # {why}" if c else f"# {why}" for c, why in advice(v, asked)]
    if steps:
        sections.append(Section("What to do next", [Code("\n".join(steps))], "next"))
    known = [("plant", f"{v.plant} {v.plant_version}"), ("question", v.question),
             ("judged on", v.judged_on), ("time", f"{v.seconds:.0f} s"), *facts]  # fmt: skip
    title = "What is new" if v.question == "changed" else "Where the simulator is wrong"
    lead = v.headline[0].upper() + v.headline[1:] + "."
    return Page(title, sections, lead, [(n, x) for n, x in known if x])


def answer_table(places: Sequence[PlaceTold]) -> Table:
    """Where, which law, what name; a row for each place."""
    rows = [
        (
            " or ".join((p.words, *p.near)),
            " or ".join(f"{x:.2f}" for x in p.probabilities),
            f"{p.share:.2f}",
            "; ".join(t.text for t in p.read),
            "yes" if p.in_simulator else "no",
            name_words(p),
        )
        for p in places
    ]
    header = ("where", "probability", "share, held out", "law: change for each unit of",
              "helps the simulator", "name")  # fmt: skip
    return Table(header, rows, numeric=frozenset((2,)))


def _answer(v: Verdict) -> list[Block]:
    out: list[Block] = []
    if v.outcome != REFUSED and v.question != "changed":
        out.append(
            Text(f"Other values of the parameters take {100 * v.parameters_take:.0f} % of the gap.")
        )
    if v.places:
        out.append(answer_table(v.places))
    out += [Text(line, "note") for line in (*repeated_lines(v), *v.notes)]
    return out or [Text("Nothing stands out of what the readings' own noise explains.")]


def _laws(answer: Answer) -> list[Block]:
    listing = answer.listed
    if listing is None or not answer.verdict.places or not listing.steps:
        return []
    settler, last = listing.settler, listing.settled[-1]
    found = settler.found.law_of(last.columns, last.x[len(settler.gap.plant.parameters) :])
    return figures.laws(
        settler.gap.plant,
        settler.gap.point,
        [p.run for p in settler.gap.played],
        answer.verdict.places,
        found,
    )


def budget(v: Verdict) -> list[Block]:
    """Where the gap goes, signal by signal: bars from zero, and the numbers."""
    of, less = budget_stages(v.question)
    names = [s.signal for s in v.budget]
    stages: list[tuple[str, Sequence[float]]] = [
        ("raw", [s.raw for s in v.budget]),
        (less, [s.parameters for s in v.budget]),
    ]
    if v.places:
        stages.append(("and laws", [s.final for s in v.budget]))
    told = [p.words for p in v.places] if v.whole and len(v.whole.places) == len(v.places) else []
    rows = [
        (s.signal, s.unit, *(f"{x:.3g}" for x in (s.raw, s.parameters, *s.places, s.floor)))
        for s in (*v.budget, *([v.whole] if v.whole else []))
    ]
    count = 4 + (len(v.whole.places) if v.whole else 0) - 1
    header = ("signal", "unit", "raw", less, *(f"+ {w}" for w in told), "floor")
    return [
        Picture(
            figures.budget(names, [s.floor for s in v.budget], stages),
            f"RMS of {of} in floors, each run judged by a model that had no part of it.",
        ),
        Table(header, rows, numeric=frozenset(range(2, 2 + count))),
    ]


def _course(answer: Answer) -> Picture:
    """The run with the largest gap: measured, as configured, and with everything told."""
    assert answer.listed is not None
    listing = answer.listed
    gap, v = listing.settler.gap, answer.verdict
    k = int(np.argmax([r.raw for r in v.by_run]))
    played, values, valid = gap.played[k], gap.measured.values[k], gap.measured.valid[k]
    (raw,) = predictions(gap.plant, listing.settler.start, [played])
    floors = {s.signal: s.floor for s in v.budget}
    channels = gap.plant.channels
    left = np.where(valid, values - raw, np.nan)
    size = {
        i: float(np.nanmean(left[:, i] ** 2)) / floors[c.name] ** 2
        for i, c in enumerate(channels)
        if c.name in floors and valid[:, i].any()
    }
    order = sorted(size, key=lambda i: -size[i])[:_SIGNALS]
    curves = (
        figures.Curve(np.where(valid, values, np.nan), "measured", "main"),
        figures.Curve(raw, "simulator as configured", "reference", "--"),
        figures.Curve(listing.predicted[-1][k], "with what is told", "y"),
    )
    return figures.courses(
        "Measured and simulated",
        f"{played.whole.name}, the run with the largest gap: the signals that are furthest off. "
        "The model with what is told had no part of this run.",
        period_s=played.period_s,
        shown={i: f"{channels[i].name}, {channels[i].unit}" for i in order},
        curves=curves,
    )


def parameters(v: Verdict) -> Table:
    """The parameters before and in the model that is told."""
    rows = [
        (q.name, q.unit, f"{q.before:.5g}", f"{q.after:.5g}", f"{q.sd:.2g}",
         "at the end of its range" if q.at_bound else "")
        for q in v.parameters
    ]  # fmt: skip
    header = ("parameter", "unit", "before", "in the model", "± sd", "")
    caption = (
        "sd is what the scatter of these runs leaves open, laws that are told beside them free."
    )
    return Table(header, rows, caption, frozenset((2, 3, 4)))


def unseen(v: Verdict) -> Table:
    """For each place the size that the runs would have shown."""
    return Table(("place", "size"), [tuple(text.split(": ", 1)) for text in v.unseen])


def _runs(v: Verdict) -> list[Block]:
    gaps = {r.run: r for r in v.by_run}
    rows = []
    for r in v.runs:
        own = gaps.get(r.name)
        numbers = (f"{own.raw:.1f}", f"{own.final:.1f}", f"{own.apart:.2f}") if own else ("",) * 3
        rows.append((r.name, r.role, f"{r.duration_s:.0f} s", *numbers, r.sha256[:16]))
    header = ("run", "role", "length", "gap before", "gap after", "own state", "SHA-256")
    caption = ("Gaps in floors. Own state is the share that coefficients of its own would take of "
               "a run beyond those of the others.")  # fmt: skip
    out: list[Block] = [Table(header, rows, caption, frozenset((3, 4, 5)))]
    return out + [Text(f"{f.run}: {f.text}", "warning" if f.refuses else "note")
                  for f in v.findings]  # fmt: skip
