"""Scores of a bank of check-ups over strength, and what it said of benches without a listed effect.

The tables are put into a page by this command only, between `<!-- scores -->` and `<!-- end -->`.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

from smad.gap.check.intervals import wilson
from smad.gap.check.key import file_digest
from smad.gap.check.names import canonical
from smad.gap.check.verdicts import NOT_CAUSES
from tests.withheld.errors import BankError
from tests.withheld.seals import require_logged

EDGES = (0.3, 1.0, 3.0, 10.0, 30.0)
"""Strengths: what an effect changes of the signal that shows it most, in repeat floors."""
_FIRST = 3
_SEVERAL = {"pair": "two effects", "triple": "three effects"}
_OTHER_DAYS = {
    "room": "the room 4 K warmer",
    "preload": "another preload",
    "drift": "a bench that drifts within the check-up",
}
_SIMPLER = {
    "match": "largest signature match, days and form left in",
    "bic": "best Bayesian information criterion",
    "random": "random",
}
_SAID = {
    "unknown": "unknown",
    "effect": "another name",
    "ambiguous": "a group of names",
    "parameters_only": "other parameters",
    "no_gap": "no change",
}
_FLOORS = ("displacement_mm", "rtd_x_degC")


@dataclass(frozen=True)
class Scored:
    """A case beside its verdict; `ranked` are the sets of names with probabilities, best first.

    `first` is the likeliest name.
    `simpler` has what each simpler rule names, `without` what was said with the right entry out of
    the library.
    """

    kind: str
    strength: float
    names: frozenset[str]
    outcome: str
    ranked: tuple[tuple[frozenset[str], float], ...]
    first: str
    group: frozenset[str]
    left: float
    seconds: float
    simpler: Mapping[str, frozenset[str]]
    without: tuple[str, ...] = ()

    @property
    def detected(self) -> bool:
        """Whether it was called changed."""
        return self.outcome != "no_gap"

    @property
    def named(self) -> frozenset[str]:
        """The names that the verdict gives, none for unknown and parameters."""
        if self.outcome == "ambiguous":
            return self.group
        if self.outcome != "effect":
            return frozenset()
        return next(names for names, _ in self.ranked if not names & NOT_CAUSES)

    @property
    def right_first(self) -> bool:
        """Whether the verdict begins with a name that is there."""
        return bool(self.named) and self.first in self.names

    @property
    def exact(self) -> bool:
        """Whether the truth is named, and nothing else."""
        return self.outcome == "effect" and self.named == self.names

    @property
    def in_first(self) -> bool:
        """Whether the truth is among the three likeliest."""
        return any(names == self.names for names, _ in self.ranked[:_FIRST])

    @property
    def on_truth(self) -> float:
        """Probability that was given to the truth."""
        truth = {"unknown": frozenset(("unknown",)), "parameters": frozenset(("parameters",))}
        wanted = truth.get(self.kind, self.names)
        return sum(p for names, p in self.ranked if names == wanted)


def scored(verdicts: Path, key: Path, only: Iterable[str] | None = None) -> list[Scored]:
    """All cases of a verdict file, or some.

    Raises BankError when the key is of another bank, and SmadError when verdicts on the sealed bank
    were not scored, and logged, before.
    """
    told = json.loads(verdicts.read_text())
    known = json.loads((key / "KEY.json").read_text())
    if known["bank"] != told["bank"]:
        raise BankError(f"{verdicts} is of bank {told['bank']}, the key of {known['bank']}")
    require_logged(known["bank"], file_digest(key / "KEY.json"), verdicts)
    out = []
    for name in sorted(told["verdicts"] if only is None else only):
        v = told["verdicts"][name]
        entry = known["cases"][name]
        ranked = tuple(
            (frozenset(canonical(n) for n in c["names"]), c["probability"]) for c in v["causes"]
        )
        out.append(
            Scored(
                kind=entry["kind"],
                strength=entry["gap_worst"],
                names=frozenset(canonical(e["name"]) for e in entry["effects"]),
                outcome=v["outcome"],
                ranked=ranked,
                first=_first_name(v["causes"]),
                group=frozenset(canonical(n) for n in v["group"]),
                left=1.0 - v["shrink"],
                seconds=v["seconds"],
                simpler={
                    rule: frozenset(canonical(n) for n in said["names"])
                    for rule, said in v.get("baselines", {}).items()
                },
                without=tuple(said["outcome"] for said in v.get("left_out", {}).values()),
            )
        )
    return out


def _first_name(causes: Sequence[Mapping[str, Any]]) -> str:
    """The name that the likeliest hypothesis with a name begins with."""
    names = (canonical(c["names"][0]) for c in causes)
    return next((n for n in names if n not in NOT_CAUSES), "")


def tables(cases: Sequence[Scored]) -> str:
    """Everything as Markdown."""
    parts = (_by_strength(cases), _others(cases), _simpler(cases), _without(cases), _seconds(cases))
    return "\n\n".join(p for p in parts if p) + "\n"


def _by_strength(cases: Sequence[Scored]) -> str:
    single = [c for c in cases if c.kind == "single"]
    if not single:
        return ""
    lines = [
        "| one effect of the library, floors | cases | detected | of these right first | alone "
        "| among the first three | probability of the truth |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    spans = [(0.0, EDGES[0]), *pairwise(EDGES), (EDGES[-1], math.inf)]
    for low, high in [*spans, (0.0, math.inf)]:
        inside = [c for c in single if low <= c.strength < high]
        if not inside:
            continue
        seen = [c for c in inside if c.detected]
        lines.append(
            f"| {_span(low, high)} | {len(inside)} | {_share(inside, lambda c: c.detected)} | "
            f"{_share(seen, lambda c: c.right_first)} | "
            f"{_share(seen, lambda c: c.exact)} | "
            f"{_share(seen, lambda c: c.in_first)} | {_mean(seen)} |"
        )
    return "\n".join(lines)


def _others(cases: Sequence[Scored]) -> str:
    def of(kind: str) -> list[Scored]:
        return [c for c in cases if c.kind == kind]

    unknown = [c for c in of("unknown") if c.detected]
    rows = [
        ("nothing", "false alarms", of("none"), lambda c: c.detected),
        ("other parameter values", "a name that is not there", of("parameters"),
         lambda c: bool(c.named)),
        ("an effect outside the library", "detected", of("unknown"), lambda c: c.detected),
        ("the same, detected", "said to be unknown", unknown, lambda c: c.outcome == "unknown"),
        ("the same, detected", "called by a name of the library", unknown,
         lambda c: bool(c.named)),
    ]  # fmt: skip
    for kind, matter in _SEVERAL.items():
        seen = [c for c in of(kind) if c.detected]
        rows += [
            (matter, "detected", of(kind), lambda c: c.detected),
            ("the same, detected", "all named, and nothing else", seen, lambda c: c.exact),
            ("the same, detected", "at least one named, none wrong", seen,
             lambda c: bool(c.named) and c.named <= c.names),
        ]  # fmt: skip
    for kind, matter in _OTHER_DAYS.items():
        rows += [
            (matter, "called changed", of(kind), lambda c: c.detected),
            (matter, "a name that is not there", of(kind), lambda c: bool(c.named)),
        ]
    lines = ["| what was the matter | what it said | cases | share |", "|---|---|---:|---:|"]
    lines += [
        f"| {matter} | {said} | {len(inside)} | {_share(inside, right)} |"
        for matter, said, inside, right in rows
        if inside
    ]
    return "\n".join(lines)


def _simpler(cases: Sequence[Scored]) -> str:
    """Simpler rules on the same check-ups. They name something always, or nothing."""
    seen = [c for c in cases if c.kind == "single" and c.detected]
    quiet = [c for c in cases if c.kind == "none"]
    if not seen or not seen[0].simpler:
        return ""
    lines = [
        "| rule | right first, of the effects that the check-up noticed | a name where nothing "
        "is the matter |",
        "|---|---:|---:|",
        f"| check-up | {_share(seen, lambda c: c.right_first)} | "
        f"{_share(quiet, lambda c: bool(c.named))} |",
    ]
    for rule, title in _SIMPLER.items():
        right, alarm = _by_rule(rule)
        lines.append(f"| {title} | {_share(seen, right)} | {_share(quiet, alarm)} |")
    return "\n".join(lines)


def _by_rule(rule: str) -> tuple[Callable[[Scored], bool], Callable[[Scored], bool]]:
    return lambda c: c.simpler[rule] == c.names, lambda c: bool(c.simpler[rule])


def _without(cases: Sequence[Scored]) -> str:
    """What was said with the right entry out of the library."""
    said = [o for c in cases for o in c.without]
    if not said:
        return ""
    counts = "; ".join(
        f"{title} {said.count(outcome)}" for outcome, title in _SAID.items() if outcome in said
    )
    low, high = wilson(said.count("unknown"), len(said))
    share = said.count("unknown") / len(said)
    return (
        f"With the right entry out of the library, {len(said)} noticed single effects: {counts}. "
        f"*Unknown* is right: {share:.2f} ({low:.2f}–{high:.2f})."
    )


def beside(given: Mapping[str, Path], key: Path, title: str) -> str:
    """Several verdict files over one key, a row each, over the cases that all of them have."""
    told = {label: json.loads(path.read_text()) for label, path in given.items()}
    common = set.intersection(*(set(t["verdicts"]) for t in told.values()))
    benches = set.intersection(*(set(t["floors"]) for t in told.values()))
    lines = [
        f"| {title} | floor of displacement, mm | of an RTD, K | false alarms | noticed below 1 "
        "floor | 1 to 3 | above 3 | right first, of the noticed | mean probability of the truth "
        "| new effects called by a name |",
        "|---|" + "---:|" * 9,
    ]
    for label, path in given.items():
        cases = scored(path, key, common)
        single = [c for c in cases if c.kind == "single"]
        seen = [c for c in single if c.detected]
        new = [c for c in cases if c.kind == "unknown" and c.detected]
        quiet = [c for c in cases if c.kind == "none"]
        parts = [
            [c for c in single if low <= c.strength < high]
            for low, high in ((0.0, 1.0), (1.0, 3.0), (3.0, math.inf))
        ]
        cells = [
            *(f"{median(told[label]['floors'][b][s] for b in benches):.3g}" for s in _FLOORS),
            _share(quiet, lambda c: c.detected),
            *(_share(part, lambda c: c.detected) for part in parts),
            _share(seen, lambda c: c.right_first),
            _mean(seen),
            _share(new, lambda c: bool(c.named)),
        ]
        lines.append(f"| {label} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _seconds(cases: Sequence[Scored]) -> str:
    took = [c.seconds for c in cases]
    return (
        f"A verdict took {median(took):.1f} s of processor time (median), "
        f"{max(took):.1f} s at most, over {len(cases)} cases."
    )


def _span(low: float, high: float) -> str:
    if math.isinf(high):
        return "all" if low == 0.0 else f"above {low:g}"
    return f"below {high:g}" if low == 0.0 else f"{low:g} to {high:g}"


def _share(cases: Sequence[Scored], right: Callable[[Scored], bool]) -> str:
    """A share with its 95 % interval."""
    if not cases:
        return "–"
    hits = sum(right(c) for c in cases)
    low, high = wilson(hits, len(cases))
    return f"{hits / len(cases):.2f} ({low:.2f}–{high:.2f})"


def _mean(cases: Sequence[Scored]) -> str:
    return f"{sum(c.on_truth for c in cases) / len(cases):.2f}" if cases else "–"


def put_into(page: Path, text: str, mark: str = "scores") -> None:
    """Replace what stands between the marks of a page. Raises BankError where there are none."""
    marked = re.compile(rf"(<!-- {mark} -->\n).*?(<!-- end -->)", re.DOTALL)
    before = page.read_text()
    after, count = marked.subn(lambda m: f"{m[1]}{text}{m[2]}", before)
    if count != 1:
        raise BankError(f"{page} has {count} places for {mark}: mark one with <!-- {mark} -->")
    page.write_text(after)


def report(
    verdicts: Path, key: Path, page: Path | None, note: str, mark: str = "scores"
) -> dict[str, Any]:
    """Print the tables; with `page` put them there, below a line that says what they are of."""
    cases = scored(verdicts, key)
    text = tables(cases)
    print(text)
    if page is not None:
        put_into(page, f"{note}\n\n{text}", mark)
    return {"cases": len(cases)}
