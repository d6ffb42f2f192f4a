"""How investigations of benches with a hidden effect ended, counted beside the answers."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import mean, median
from typing import Any

import msgspec

from evaluation.errors import QuizError
from evaluation.names import canonical
from evaluation.score.answers import Cause
from evaluation.score.intervals import wilson
from smad.checkup.investigation import Report
from smad.checkup.programme import Programme
from smad.checkup.proposal import ALL_PLAYED, ONE_LEFT
from smad.diagnosis.verdict import CAUSES, PARAMETERS, QUIET, UNEXPLAINED
from smad.report.page import Table

End = dict[str, Any]
"""What an investigation concluded, beside the answer."""


def end_of(answer: dict[str, Any], report: Report, spent_s: float, programme: Programme) -> End:
    """What an investigation concluded, beside the answer."""
    assert report.verdict is not None
    verdict = report.verdict
    causes = msgspec.convert(msgspec.to_builtins(verdict.causes), list[Cause])
    names = {c.reported_name for c in causes if c.reported_name}
    return {
        "seed": answer["seed"],
        "effects": [canonical(e["name"]) for e in answer["effects"]],
        "listed": all(e["listed"] for e in answer["effects"]),
        "outcome": verdict.outcome,
        "names": sorted(canonical(n) for n in names),
        "place": causes[0].place if causes else "",
        "reported_places": sorted(causes[0].reported_places) if causes else [],
        "true_places": sorted({p for e in answer["effects"] for p in e["places"]}),
        "gap_floors": None if verdict.whole is None else round(verdict.whole.raw, 2),
        "why_over": report.why_over,
        "ended_early": sum(bool(r.ended) for r in report.records),
        "further_runs": max(
            0,
            sum(not r.held_out for r in report.records) - sum(run.quick for run in programme.runs),
        ),
        "minutes": round(spent_s / 60.0, 1),
    }


_ENDS = {
    "rightly": "settled rightly",
    "with a wrong name": "right name and a wrong one",
    "wrongly": "settled wrongly",
    "not noticed": "not noticed",
    "said to be unknown": "called unknown",
}
"""How an investigation may end, and the head of its column."""


def mark(case: End) -> str:
    """How an investigation ended, one of `_ENDS`; an effect of no list is rightly unknown, and a
    bench on which nothing is wrong rightly quiet.
    """
    if not case["effects"]:
        return _unchanged(case)
    if case["outcome"] == QUIET:
        return "not noticed"
    if case["outcome"] in (CAUSES, UNEXPLAINED) and not case["names"]:
        return "said to be unknown" if case["listed"] else "rightly"
    if case["outcome"] != CAUSES or not case["listed"]:
        return "wrongly"
    truth, named = set(case["effects"]), set(case["names"])
    return "rightly" if named == truth else "with a wrong name" if truth & named else "wrongly"


def _unchanged(case: End) -> str:
    return "rightly" if case["outcome"] == QUIET else "wrongly"


def placed(case: End) -> str:
    """How it ended as to the likeliest place, one of `_ENDS`."""
    return _placed(case, {case["place"]})


def placed_among(case: End) -> str:
    """How it ended as to all places that are reported as possible, one of `_ENDS`."""
    return _placed(case, _reported_places(case))


def _reported_places(case: End) -> set[str]:
    # Ends of before 29 November 2026 have the likeliest alone.
    return {case["place"], *case.get("reported_places", ())}


def _placed(case: End, places: set[str]) -> str:
    if not case["effects"]:
        return _unchanged(case)
    if case["outcome"] == QUIET:
        return "not noticed"
    if not case["place"]:
        return "wrongly" if case["outcome"] == PARAMETERS else "said to be unknown"
    return "rightly" if places & set(case["true_places"]) else "wrongly"


def run(seeds: Sequence[int], out: Path, investigated: Callable[[int], End]) -> None:
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
        print(
            f"{seed} {mark(c)}: {c['effects']} {c['outcome']} {c['names']} {c['minutes']} min; "
            f"{c['why_over']}",
            flush=True,
        )
    if failed:
        raise QuizError(f"not finished: {', '.join(failed)}; the same command tries them again")


def ended(out: Path) -> list[End]:
    """What became of every bench of a folder."""
    return [json.loads(path.read_text()) for path in sorted(out.glob("*.json"))]


def _decided(case: End) -> bool:
    why: str = case.get("why_over", "")
    return why.startswith((ONE_LEFT, ALL_PLAYED) if case["outcome"] == QUIET else ONE_LEFT)


def table(cases: Sequence[End]) -> Table:
    """How they ended, apart for effects in the library and others, and for those in which one rival
    or nothing was left: the others leave several, spent their time or had a run ended early."""
    rows = []
    unchanged = [c for c in cases if not c["effects"]]
    listed = [c for c in cases if c["effects"] and c["listed"]]
    other = [c for c in cases if not c["listed"]]
    decided = [c for c in cases if _decided(c)]
    groups = (
        ("in the library", listed),
        ("not in it", other),
        ("none", unchanged),
        ("all", cases),
        ("one rival or nothing left", decided),
    )
    for title, members in (group for group in groups if group[1]):
        took = [c["minutes"] for c in members]
        minutes = f"{median(took):.1f} ({max(took):.1f})"
        counts = [len(_reported_places(c)) for c in members if c["place"]]
        several = f"one of {mean(counts):.1f} places" if counts else "one of the places"
        for what, how in (("name", mark), ("likeliest place", placed), (several, placed_among)):
            ends = [how(c) for c in members]
            shares = (_share(ends.count(end), len(members)) for end in _ENDS)
            rows.append((f"{title}: {what}", str(len(members)), *shares, minutes))
    head = (
        "the trouble", "simulated benches", *_ENDS.values(), "minutes of bench time, median (most)"
    )  # fmt: skip
    return Table(head, rows, numeric=frozenset(range(1, len(head))))


def _share(hits: int, count: int) -> str:
    low, high = wilson(hits, count)
    return f"{hits / count:.2f} ({low:.2f}–{high:.2f})"
