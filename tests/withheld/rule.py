"""Constants of the one rule from score tables of a development bank, with their reliability."""

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from smad.gap.check.names import canonical
from smad.gap.paired.calibrate import LEAST_PROBABILITY, measured, reliability_table
from tests.withheld.calibrating import toml_of
from tests.withheld.engine.rule import Constants, Ruling, Weighed, ruled, shares_of
from tests.withheld.engine.table import Kind
from tests.withheld.tables import read

FORMS = (0.06, 0.1, 0.15, 0.2, 0.3, 0.45, 0.6)
TEMPERS = (0.5, 1.0, 2.0, 4.0, 8.0)
MOVED = (30.0, 100.0, 300.0, 1000.0)
STEEP = (1.0, 2.0, 4.0, 8.0)
ODDS = (2.0, 3.0, 5.0, 10.0)
PRIORS = tuple(product((0.1, 0.3, 1.0), (0.3, 1.0, 3.0, 10.0), (0.1, 0.3, 1.0)))
FIRST = Constants(0.2, 0.3, 0.2, temper=2.0, form=0.2, moved=300.0, steep=2.0, odds=3.0)
_QUIET = {"none": Kind.NOTHING, "parameters": Kind.PARAMETERS, "unknown": Kind.UNKNOWN}


@dataclass(frozen=True)
class Known:
    """A case whose truth is known, weighed under each of `FORMS`; `told` as in its table."""

    case: str
    kind: Kind
    names: frozenset[str]
    floors: float
    weighed: dict[float, Weighed]
    told: dict[str, Any]

    def given(self, constants: Constants) -> float:
        """The probability that the rule gives to the truth."""
        weighed = self.weighed[constants.form]
        shares = shares_of(weighed.table.rows, weighed.posterior(constants))
        return shares.get((self.kind, self.names), 0.0)

    def rule(self, constants: Constants) -> Ruling:
        """What the rule says."""
        return ruled(self.weighed[constants.form], constants)


def known_cases(tables: Path, key: Path) -> list[Known]:
    """The cases with a table, asked since known-good runs, with their truth."""
    entries = json.loads((key / "KEY.json").read_text())["cases"]
    out = []
    for path in sorted(tables.glob("case-*.npz")):
        table, told = read(path)
        entry = entries[told["case"]]
        if entry["kind"] == "differs":
            continue
        kind = _QUIET.get(entry["kind"], Kind.KNOWN)
        names = [e["name"] for e in entry["effects"]] if kind is Kind.KNOWN else []
        truth = frozenset(canonical(n) for n in names)
        # Where the library splits what a key has as one cause, all of them are the same answer.
        listed = [replace(r, names=tuple(canonical(n) for n in r.names)) for r in table.rows]
        table = replace(table, rows=tuple(listed))
        weighed = {form: Weighed.of(table, form) for form in FORMS}
        floors = float(entry["target_floors"])
        out.append(Known(told["case"], kind, truth, floors, weighed, told))
    return out


def fitted(cases: Sequence[Known]) -> Constants:
    """The constants with the best mean log probability of the truth, one after the other, thrice.

    `odds` does not move a probability: it is chosen by what is named, rightly less wrongly.
    """
    best = FIRST
    for _ in range(3):
        for choices in _CHOICES:
            tried = [msgspec.structs.replace(best, **choice) for choice in choices]
            best = max(tried, key=lambda c: sum(_log(k.given(c)) for k in cases))
    named = [msgspec.structs.replace(best, odds=o) for o in ODDS]
    return max(named, key=lambda c: sum(worth(k, k.rule(c)) for k in cases))


_CHOICES: tuple[list[dict[str, float]], ...] = (
    [{"parameters": p, "known": k, "unknown": u} for p, k, u in PRIORS],
    [{"temper": t, "form": f} for t, f in product(TEMPERS, FORMS)],
    [{"moved": m, "steep": s} for m, s in product(MOVED, STEEP)],
)


def worth(case: Known, said: Ruling) -> float:
    """1 for what is right, -1 for a name or an alarm that is wrong, 0 for silence."""
    return {"right": 1.0, "in the group": 0.5, "part": 0.5, "silent": 0.0, "unknown": 0.0}.get(
        mark(case.kind, case.names, said.kind, said.names, said.group), -1.0
    )


def mark(
    kind: Kind,
    names: frozenset[str],
    said: Kind,
    named: Iterable[str],
    group: Iterable[str],
) -> str:
    """How an answer stands to the truth, in a word or two."""
    told, near = frozenset(named), frozenset(group)
    if said is Kind.KNOWN:
        if kind is not Kind.KNOWN:
            return "false name"
        if told == names:
            return "right" if not near else "in the group"
        if told & names:
            return "part" if told < names else "right and a wrong one"
        return "in the group" if near & names else "wrong name"
    if said is kind:
        return "right"
    if said is Kind.UNKNOWN:
        return "unknown" if kind is Kind.KNOWN else "false alarm"
    return "silent"


def _log(p: float) -> float:
    return float(np.log(max(p, LEAST_PROBABILITY)))


def left_out(cases: Sequence[Known], folds: int = 6) -> list[tuple[Known, Constants]]:
    """Each case, which is a bench of its own, with constants from benches of other folds."""
    out = []
    for fold in range(folds):
        others = [c for i, c in enumerate(cases) if i % folds != fold]
        constants = fitted(others)
        out += [(c, constants) for i, c in enumerate(cases) if i % folds == fold]
    return out


def reliability_lines(title: str, judged: Sequence[tuple[Known, Constants]]) -> list[str]:
    """How well probabilities fit, as a table; an answer is a kind, or a set of names."""
    given, right, truths = [], [], []
    for case, constants in judged:
        weighed = case.weighed[constants.form]
        shares = shares_of(weighed.table.rows, weighed.posterior(constants))
        truths.append(shares.get((case.kind, case.names), 0.0))
        for answer, p in shares.items():
            given.append(p)
            right.append(float(answer == (case.kind, case.names)))
    return reliability_table(f"{title}: ", measured(given, right, truths))


def _before(case: Known) -> tuple[Kind, list[str], list[str]]:
    """What the rule in force said."""
    said = case.told["before"]
    kind = {
        "no gap": Kind.NOTHING,
        "not enough excitation": Kind.NOTHING,
        "parameters only": Kind.PARAMETERS,
        "unknown": Kind.UNKNOWN,
    }.get(said["outcome"], Kind.KNOWN)
    if kind is not Kind.KNOWN:
        return kind, [], []
    named, group = ([canonical(n) for n in said[k]] for k in ("effects", "group"))
    return kind, named, group


def compare_lines(judged: Sequence[tuple[Known, Constants]]) -> list[str]:
    """The rule in force and this one on the same runs, case by case and in all."""
    lines, counts = [], (Counter[str](), Counter[str]())
    for case, constants in judged:
        said = case.rule(constants)
        answers = (_before(case), (said.kind, said.names, said.group))
        marks = [mark(case.kind, case.names, *a) for a in answers]
        for count, m in zip(counts, marks, strict=True):
            count[m] += 1
        truth = ", ".join(sorted(case.names)) or case.kind.value
        told = [
            " + ".join(a[1]) + (f" or {', '.join(a[2])}" if a[2] else "") or a[0].value
            for a in answers
        ]
        lines.append(
            f"{case.case} {case.floors:>4g} {truth:<34.34} {marks[0]:<16.16} {told[0]:<40.40} "
            f"{marks[1]:<16.16} {told[1]:<40.40} {said.probability:.2f}"
        )
    for title, count in zip(("before", "now"), counts, strict=True):
        lines.append(f"{title}: " + ", ".join(f"{m} {n}" for m, n in sorted(count.items())))
    seconds = [c.told["seconds"] for c, _ in judged]
    for name in ("prepare", "table", "before"):
        found = [s[name] for s in seconds]
        lines.append(f"{name}: median {np.median(found):.0f} s of processor time, most "
                     f"{max(found):.0f} s")  # fmt: skip
    return lines


def calibrate(tables: Path, key: Path, out: Path | None, *, cases: bool = False) -> Constants:
    """Fits the constants, prints how reliable they are, and writes them to `out`."""
    known = known_cases(tables, key)
    counts = Counter(c.kind.value for c in known)
    print(f"{len(known)} cases: " + ", ".join(f"{n} {k}" for k, n in sorted(counts.items())))
    after, held = fitted(known), left_out(known)
    for title, judged in (
        ("before, by constants of no bank", [(c, FIRST) for c in known]),
        ("each bench by constants from others", held),
        ("after, on the benches they come from", [(c, after) for c in known]),
    ):
        print("\n".join(reliability_lines(title, judged)))
    lines = compare_lines(held)
    print("\n".join(lines if cases else [x for x in lines if not x.startswith("case-")]))
    for name in after.__struct_fields__:
        print(f"  {name:<14} {getattr(FIRST, name):>7g} -> {getattr(after, name):g}")
    if out is not None:
        head = f"# Written by `python -m tests.withheld calibrate-rule` from {len(known)} cases.\n"
        out.write_text(toml_of(head, after))
    return after
