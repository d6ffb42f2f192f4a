"""Published scores to read: tables, a text for the terminal, and one HTML page."""

from __future__ import annotations

from collections.abc import Mapping

from smad.gap.check.names import CAUSES
from smad.gap.check.score import mistakes_table, number
from smad.report.page import Block, Page, Picture, Section, Table, Text, text_table
from tests.withheld.score_figures import confusion as confusion_figure
from tests.withheld.score_figures import reliability, strengths
from tests.withheld.scores import Published

_MET = {True: "yes", False: "no", None: ""}
_QUIET = {"none": "no_gap", "parameters": "parameters_only"}
_MOST_MISTAKES = 40

CAVEAT = (
    "Every figure is about the family of simulated benches that this bank was made with, until a "
    "real bench says otherwise."
)


def table(scores: Published) -> Table:
    """The table of scores with its goals."""
    return Table(
        ("score", "value [95 %]", "cases", "goal", "met"),
        [(r.name, number(r), str(r.count), r.goal, _MET[r.met]) for r in scores.table],
        numeric=frozenset({1, 2}),
    )


def beside(scores: Published) -> Table | None:
    """The diagnosis and the baselines side by side; None when no baseline was handed in."""
    if not scores.baselines:
        return None
    names = list(scores.baselines)
    first = scores.baselines[names[0]]
    rows = [
        (row.name, *(number(scores.baselines[n][i]) for n in names)) for i, row in enumerate(first)
    ]
    columns = frozenset(range(1, 1 + len(names)))
    return Table(("score", *names), rows, numeric=columns)


def text(scores: Published) -> str:
    """The scores for a terminal."""
    parts = [f"{scores.answered} of {scores.cases} cases answered\n", text_table(table(scores))]
    others = beside(scores)
    if others is not None:
        parts += ["\nbaselines on the same data\n", text_table(others)]
    return "\n".join(p.rstrip("\n") for p in parts)


def page(scores: Published, facts: list[tuple[str, str]]) -> Page:
    """Everything that is scored, as one page."""
    others = beside(scores)
    sections = [
        Section("Scores", [Text(CAVEAT, "note"), table(scores)], "scores"),
        Section("By strength", _strengths(scores), "strength"),
        Section(
            "Baselines on the same data",
            [others] if others else [Text("The verdicts carry none.")],
            "baselines",
        ),
        Section("Calibration", _calibration(scores), "calibration"),
        Section("Confusion", _confusion(scores), "confusion"),
        Section("Mistakes, the most confident first", _mistakes(scores), "mistakes"),
    ]
    if scores.trusted:
        sections.append(Section("What the model is trusted to", _trusted(scores), "trusted"))
    if scores.model_against_bench:
        sections.append(Section("Model against bench", _compared(scores), "differs"))
    answered = ("cases answered", f"{scores.answered} of {scores.cases}")
    return Page(f"Withheld check: bank {scores.bank}", sections, "", [answered, *facts])


def _strengths(scores: Published) -> list[Block]:
    return [
        Picture(
            strengths(scores.by_strength),
            "Wilson's 95 % intervals; green marks are goals. The strength is the largest gap of a "
            "signal over the floor that the withheld plant itself leaves after a refit.",
        )
    ]


def _calibration(scores: Published) -> list[Block]:
    if not scores.calibration:
        return [Text("No verdict carries probabilities.")]
    return [
        Picture(
            reliability(scores.calibration),
            "How often the first answer was right, against the probability it was given. "
            "Numbers are cases; on the dashed line the probabilities are true.",
        )
    ]


def _confusion(scores: Published) -> list[Block]:
    several = {t: said for t, said in scores.confusion.items() if " + " in t}
    single = {t: s for t, s in scores.confusion.items() if t not in several}
    order = sorted(single, key=_place)
    blocks: list[Block] = []
    if order:
        merged = {t: _merged(single[t]) for t in order}
        title = "One effect, an unknown one, or none"
        svg = confusion_figure(merged, {t: _right(t) for t in order}, title)
        blocks.append(Picture(svg, "Green: the right answer. Cells count cases."))
    if several:
        rows = [
            (t, ", ".join(f"{s} ({n})" if n > 1 else s for s, n in said.items()))
            for t, said in several.items()
        ]
        blocks.append(Table(("effects at work together", "said"), rows))
    return blocks


def _merged(said: dict[str, int]) -> dict[str, int]:
    out: dict[str, int] = {}
    for name, count in said.items():
        shown = "two or more" if " + " in name else name
        out[shown] = out.get(shown, 0) + count
    return out


def _place(truth: str) -> tuple[int, int, str]:
    if truth in CAUSES:
        return 1, CAUSES.index(truth), truth
    return (0, 0, truth) if truth in _QUIET else (2, 0, truth)


def _right(truth: str) -> str:
    return "unknown" if truth.startswith("unknown: ") else _QUIET.get(truth, truth)


def _mistakes(scores: Published) -> list[Block]:
    if not scores.mistakes:
        return [Text("None.")]
    shown = scores.mistakes[:_MOST_MISTAKES]
    rest = len(scores.mistakes) - len(shown)
    said: list[Block] = [mistakes_table(shown)]
    return [*said, Text(f"{rest} more are in the JSON file.")] if rest else said


def confusion(scores: Published) -> Table:
    """What was said of every truth, and how often; the most frequent answer first."""
    rows = [
        (truth, _right(truth), ", ".join(_counted(scores.confusion[truth])))
        for truth in sorted(scores.confusion, key=_place)
    ]
    return Table(("truth", "right answer", "said (cases)"), rows)


def _counted(said: Mapping[str, int]) -> list[str]:
    return [f"{name} ({n})" for name, n in sorted(said.items(), key=lambda x: (-x[1], x[0]))]


def trusted(scores: Published) -> Table:
    """What the model is trusted to on each channel, in floors."""
    rows = [
        (t.channel, *(f"{x:.1f}" for x in (t.low, t.median, t.high)), str(t.cases))
        for t in scores.trusted
    ]
    heads = ("channel", "quartile", "median", "quartile", "cases")
    return Table(heads, rows, numeric=frozenset({1, 2, 3, 4}))


def _trusted(scores: Published) -> list[Block]:
    text = (
        "What the diagnosis trusts its model to on each channel since the known-good runs, in the "
        "floors that strengths are counted in: quartiles over the cases. An effect of fewer floors "
        "is smaller there than what the model leaves of a bench without any."
    )
    return [Text(text), trusted(scores)]


def _compared(scores: Published) -> list[Block]:
    rows = [
        (c.case, " + ".join(c.truth) or "none", c.outcome, c.said, _budget(c.budget))
        for c in scores.model_against_bench
    ]
    text = (
        "Cases of the question what differs between model and bench, without known-good runs. The "
        "first cause of the budget is the answer. They count in no other row."
    )
    return [Text(text), Table(("case", "added", "outcome", "said", "budget"), rows)]


def _budget(budget: dict[str, float]) -> str:
    return ", ".join(f"{name} {part:.0%}" for name, part in budget.items()) or "none"
