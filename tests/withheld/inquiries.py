"""`investigate` on mystery benches, unattended: commission, look for the trouble, open the answer.

The plant plays the runs that the investigation asks for, each on a day of its own, without the wire
and the daemon: what is scored is what it asks for and what it concludes.
"""

import json
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any, Protocol

from smad.gap.check.intervals import wilson
from smad.gap.check.names import canonical
from smad.gap.paired.commission import commissioned
from smad.gap.paired.files import read_file
from smad.gap.paired.inquiry import REST_S, Inquiry, Report
from smad.gap.paired.programme import Programme, ProgrammeRun, shipped
from smad.gap.paired.series import Recorded
from smad.gap.paired.verdict import CAUSE, GROUP, QUIET, UNKNOWN
from smad.gap.sma import SmaPlant
from tests.withheld.curves import put_into
from tests.withheld.errors import QuizError

REPEATS = 2
MARK = "inquiries"


class Mystery(Protocol):
    """A bench with a hidden effect, which plays runs of the programme."""

    def record(self, name: str, *, good: bool) -> Path:
        """Record a run, before the trouble or now; a day of its own each time."""

    def answer(self) -> dict[str, Any]:
        """What the trouble is; asked once it is over."""


def investigate(
    mystery: Mystery, minutes: float, folder: Path, programme: Programme
) -> dict[str, Any]:
    """One mystery bench: what the investigation concluded, beside the answer."""
    plant = SmaPlant()
    groups = [
        [read_file(mystery.record(run.name, good=True)) for _ in range(REPEATS)]
        for run in programme.runs
    ]

    def play(run: ProgrammeRun, original: Path | None) -> Recorded:
        return Recorded(mystery.record(run.name, good=False), "", run.duration_s + REST_S)

    inquiry = Inquiry(
        plant=plant,
        reference=commissioned(plant, groups),
        programme=programme,
        originals=folder,
        folder=folder / "investigation",
        play=play,
        say=_silent,
        seconds=60.0 * minutes,
    )
    report = inquiry.carry_out(_silent)
    return told(mystery.answer(), report, inquiry.spent_s(report), programme)


def told(
    answer: dict[str, Any], report: Report, spent_s: float, programme: Programme
) -> dict[str, Any]:
    """What an investigation concluded, beside the answer."""
    assert report.verdict is not None
    verdict = report.verdict
    names = list(verdict.group) if verdict.outcome == GROUP else []
    if verdict.outcome == CAUSE:
        names = list(verdict.likely[0].names)
    return {
        "seed": answer["seed"],
        "effects": [canonical(e["name"]) for e in answer["effects"]],
        "listed": all(e["listed"] for e in answer["effects"]),
        "outcome": verdict.outcome,
        "names": sorted(canonical(n) for n in names),
        "why_over": report.why_over,
        "further_runs": max(
            0,
            sum(not r.held_out for r in report.records) - sum(run.quick for run in programme.runs),
        ),
        "minutes": round(spent_s / 60.0, 1),
    }


def mark(case: dict[str, Any]) -> str:
    """How an investigation ended, one of `_ENDS`; an effect of no list is rightly unknown."""
    if case["outcome"] == GROUP:
        return "not settled"
    if case["outcome"] == UNKNOWN:
        return "said to be unknown" if case["listed"] else "rightly"
    if case["outcome"] == QUIET:
        return "not noticed"
    if case["outcome"] != CAUSE or not case["listed"]:
        return "wrongly"
    truth, said = set(case["effects"]), set(case["names"])
    return "rightly" if said == truth else "with a wrong name" if truth & said else "wrongly"


def asked(begin: Callable[[int, Path], Mystery], minutes: float) -> Callable[[int], dict[str, Any]]:
    """What investigates the bench of a number, in a folder that goes away with it."""

    def one(seed: int) -> dict[str, Any]:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            return investigate(begin(seed, folder / "runs"), minutes, folder, shipped())

    return one


def run(seeds: Sequence[int], out: Path, investigated: Callable[[int], dict[str, Any]]) -> None:
    """All seeds, a file each in `out`; those that have one are not done again.

    A bench that fails does not keep the others waiting. Raises QuizError at the end, then.
    """
    out.mkdir(parents=True, exist_ok=True)
    failed = []
    for seed in seeds:
        place = out / f"{seed}.json"
        if place.exists():
            continue
        try:
            c = investigated(seed)
        except QuizError as error:
            print(f"{seed} failed: {error}", flush=True)
            failed.append(str(seed))
            continue
        place.write_text(json.dumps(c, indent=1))
        print(f"{seed} {mark(c)}: {c['effects']} {c['outcome']} {c['names']} {c['minutes']} min; "
              f"{c['why_over']}", flush=True)  # fmt: skip
    if failed:
        raise QuizError(f"not finished: {', '.join(failed)}; the same command tries them again")


_ENDS = (
    "rightly", "with a wrong name", "wrongly", "not noticed", "said to be unknown", "not settled",
)  # fmt: skip


def table(cases: Sequence[dict[str, Any]]) -> str:
    """How they ended, as Markdown."""
    lines = [
        "| the trouble | simulated benches | settled rightly | right name and a wrong one "
        "| settled wrongly | not noticed | called unknown | not settled "
        "| minutes of bench time, median (most) |",
        "|---|" + "---:|" * 8,
    ]
    listed = [c for c in cases if c["listed"]]
    other = [c for c in cases if not c["listed"]]
    for title, own in (("in the library", listed), ("not in it", other), ("all", cases)):
        if not own:
            continue
        ends = [mark(c) for c in own]
        shares = " | ".join(_share(ends.count(e), len(own)) for e in _ENDS)
        took = [c["minutes"] for c in own]
        lines.append(f"| {title} | {len(own)} | {shares} | {median(took):.1f} ({max(took):.1f}) |")
    return "\n".join(lines) + "\n"


def _share(hits: int, count: int) -> str:
    low, high = wilson(hits, count)
    return f"{hits / count:.2f} ({low:.2f}–{high:.2f})"


def report(out: Path, page: Path | None, note: str, mark: str = MARK) -> None:
    """Print the table; with `page` put it there."""
    text = table([json.loads(path.read_text()) for path in sorted(out.glob("*.json"))])
    print(text)
    if page is not None:
        put_into(page, f"{note}\n\n{text}", mark)


def _silent(text: str) -> None:
    pass
