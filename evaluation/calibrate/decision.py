"""The constants of a diagnosis's decision, from development banks.

    python -m evaluation decide BANK … --out FOLDER [--cases case-001,…] [--as-is] [--write]

Every case is asked again with other values of each constant, the others as they are. What does not
depend on a constant is worked out once, so that only another way through the selection costs fits.
A value is chosen by all cases; how well such a choice does is told by choosing each case's value
from the other cases. Of the changes that do better so, the best is made.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest import mock

import msgspec
from smad.gap.compare.tracks import Track, follow_tracks
from smad.gap.compare.verdict import decide
from smad.gap.compare.weigh import weigh
from smad.gap.diagnose import ready
from smad.gap.fit.doubt import Doubt
from smad.gap.fit.hypothesis import ending_at_bound
from smad.gap.fit.joint import Start, polished
from smad.gap.fit.stages import Prepared
from smad.gap.records import NAMED, Outcome
from smad.gap.settings import Settings

from evaluation.score.seals import refuse_sealed
from smad.diagnosis.bank.bank import chosen, open_bank, read_case
from smad.diagnosis.bank.case import How, Task, source_digest
from smad.diagnosis.bank.key import CaseKey, read_key
from smad.diagnosis.bank.names import canonical
from smad.diagnosis.plant import Effect

GRID: dict[str, tuple[float, ...]] = {
    "since_gain": (0.7, 1.0, 1.4),
    "standard_errors": (1.4, 2.0, 2.8),
    "least_share": (0.1, 0.15, 0.2),
    "most_share": (0.35, 0.5, 0.7),
    "nearly_all": (0.8, 0.9, 0.95),
    "since_spreads": (5.6, 8.0, 11.0),
    "odds": (5.0, 10.0, 20.0),
    "form_share": (0.25, 0.35, 0.5),
}
"""Values that are tried of each constant."""
_WRONG = -2.0
"""What a wrong name, or a name where there is nothing, is worth; a right answer is worth 1."""
_QUIET = frozenset((Outcome.NO_GAP, Outcome.PARAMETERS, Outcome.NO_EXCITATION))


class Answer(msgspec.Struct, frozen=True):
    """What a verdict says; `p` is its probability before it is scaled."""

    outcome: Outcome
    names: tuple[str, ...] = ()
    group: tuple[str, ...] = ()
    imitated: bool = False
    p: float = 1.0

    def __str__(self) -> str:
        named = " or ".join([" + ".join(self.names), *self.group]) if self.names else ""
        return (
            f"{self.outcome}{', imitated' if self.imitated else ''}{': ' if named else ''}{named}"
        )

    @property
    def sort(self) -> str:
        """The kind of answer whose probability is scaled together."""
        if self.outcome in _QUIET:
            return "quiet"
        return "unsure" if self.outcome is Outcome.UNKNOWN or self.imitated else "named"


Answers = Mapping[str, Answer]
"""By "" (as it is) and "constant=value"."""


def worth(true: CaseKey, said: Answer) -> float:
    """What an answer is worth: 1 if right, 0 if silent, less for names that are not there."""
    causes = {canonical(n) for n in true.names}
    names = [canonical(n) for n in said.names]
    if true.kind in ("none", "parameters"):
        return 1.0 if said.sort == "quiet" else _WRONG if names else _WRONG / 2
    if true.kind == "unknown":
        return _WRONG if names else float(said.outcome is Outcome.UNKNOWN)
    if true.kind == "differs":
        # The bench differs from the simulator in more than the effect: other names are not wrong.
        return float(bool(causes & {*names, *map(canonical, said.group)}))
    if not names:
        return 0.0
    group = {names[0], *map(canonical, said.group)}
    if not group & causes:
        return _WRONG
    wrong = sum(n not in causes for n in names[1:])
    return 1.0 / len(group) - 0.5 * wrong


def right(true: CaseKey, said: Answer) -> bool:
    """Whether what an answer says first is so."""
    return worth(true, msgspec.structs.replace(said, names=said.names[:1])) > 0.0


@dataclass(frozen=True)
class Found:
    """The cases of a bank: what is true of each, and what is answered."""

    true: Mapping[str, CaseKey]
    said: Mapping[str, Answers]

    def total(self, name: str, value: float, cases: Sequence[str]) -> float:
        """What the answers with one constant at a value are worth."""
        return sum(worth(self.true[c], self.answer(c, name, value)) for c in cases)

    def answer(self, case: str, name: str, value: float) -> Answer:
        """The answer of a case with one constant at a value."""
        return self.said[case].get(f"{name}={value:g}", self.said[case][""])

    def best(self, name: str, now: float, cases: Sequence[str]) -> float:
        """The value that serves these cases best; of several the nearest to what it is now."""
        values = GRID[name]
        return max(values, key=lambda v: (round(self.total(name, v, cases), 9), -abs(v - now)))

    def left_out(self, name: str, now: float) -> float:
        """What the answers are worth, each with the value that serves the other cases best."""
        cases = list(self.said)
        return sum(
            worth(
                self.true[c],
                self.answer(c, name, self.best(name, now, [o for o in cases if o != c])),
            )
            for c in cases
        )


def decide_constants(
    banks: Sequence[Path],
    out: Path,
    cases: Sequence[str] = (),
    *,
    as_is: bool = False,
    write: bool = False,
) -> None:
    """Asks every case with other constants, prints what that changes, and writes the choice.

    With `as_is` cases that have not been asked yet are asked with the constants as they are only,
    which tells the shares of right answers. Raises BankError for a sealed key.
    """
    true: dict[str, CaseKey] = {}
    said: dict[str, dict[str, Answer]] = {}
    for bank in banks:
        folder = bank.with_name(f"{bank.name}-key")
        refuse_sealed(folder)
        truth, digest = read_key(folder / "KEY.json")
        opened = open_bank(bank)
        for case in chosen(opened, only=cases):
            name = f"{digest[:8]}/{case.id}"
            task = Task(opened, case, How(), source_digest())
            true[name], said[name] = truth.cases[case.id], _kept_answers(task, out / name, as_is)
            print(f"{name}  {_true(true[name])}  →  {said[name]['']}", flush=True)
    found = Found(true, said)
    print(table(found))
    constants = chosen_constants(found)
    shares = shares_right(found)
    print(reliability(found, shares))
    if write:
        keys = ", ".join(dict.fromkeys(name.partition("/")[0] for name in said))
        CONSTANTS.write_text(as_toml(constants, shares, f"{len(said)} cases, keys {keys}"))
        print(f"written  {CONSTANTS}")


def _kept_answers(task: Task, place: Path, as_is: bool) -> dict[str, Answer]:
    """The answers of a case from its file, which is made where there is none, or too little."""
    kept = place.with_suffix(".json")
    known: dict[str, Answer] = {}
    if kept.exists():
        known = msgspec.json.decode(kept.read_bytes(), type=dict[str, Answer])
    if not known or not (as_is or len(known) > 1):
        kept.parent.mkdir(parents=True, exist_ok=True)
        with readied(task) as prepared:
            known = answers(prepared, {} if as_is else GRID)
        kept.write_bytes(msgspec.json.format(msgspec.json.encode(known)))
    return known


def _true(case: CaseKey) -> str:
    return f"{case.kind} {' + '.join(sorted(case.names))} at {case.gap_worst:.1f}"


def changed(found: Found, name: str, value: float) -> list[str]:
    """The cases whose answer is another with one constant at a value."""
    return [
        f"{case}: {answers['']} → {other}"
        for case, answers in found.said.items()
        if str(other := found.answer(case, name, value)) != str(answers[""])
    ]


def table(found: Found) -> str:
    """A line for each value of each constant: what its answers are worth, and which are others."""
    settings, cases = Settings(), list(found.said)
    lines = []
    for name, values in GRID.items():
        now = getattr(settings, name)
        for value in values:
            more = changed(found, name, value)
            mark = "*" if value == now else " "
            lines.append(
                f"{name:<16} {value:>5g}{mark} worth {found.total(name, value, cases):>5.1f}"
                f"  {len(more):>2} changed  {'; '.join(more)}"
            )
        lines.append(f"{name:<16} each by the others: {found.left_out(name, now):.1f}")
    return "\n".join(lines)


def chosen_constants(found: Found) -> dict[str, float]:
    """Every constant as it is, but the one whose change does best on cases left out."""
    settings, cases = Settings(), list(found.said)
    now = {name: float(getattr(settings, name)) for name in GRID}
    as_is = sum(worth(found.true[c], found.said[c][""]) for c in cases)
    gain = {name: found.left_out(name, now[name]) - as_is for name in GRID}
    first = max(gain, key=lambda name: gain[name])
    if gain[first] > 0.0:
        now[first] = found.best(first, now[first], cases)
    return now


def shares_right(found: Found, without: str = "") -> dict[str, float]:
    """Share of right answers of each sort since known-good runs, in what their evidence said.

    Two answers more, one of them right, keep a sort that is rare from 0 and 1.
    """
    out = {}
    for sort in ("quiet", "named", "unsure"):
        mine = [c for c in _since(found) if c != without and found.said[c][""].sort == sort]
        hits = 1.0 + sum(right(found.true[c], found.said[c][""]) for c in mine)
        out[sort] = round(hits / (2.0 + sum(found.said[c][""].p for c in mine)), 2)
    return out


def _since(found: Found) -> list[str]:
    return [c for c in found.said if found.true[c].kind != "differs"]


def reliability(found: Found, shares: Mapping[str, float]) -> str:
    """Said and right of each sort: with the shares as they are, and by the other cases' shares."""
    settings = Settings()
    by_others = {c: shares_right(found, without=c) for c in _since(found)}
    lines = [
        f"{'sort':<8} {'cases':>5} {'right':>6} {'said':>6} {'others say':>11} {'new share':>10}"
    ]
    for sort, share in shares.items():
        mine = [c for c in _since(found) if found.said[c][""].sort == sort]
        if not mine:
            continue
        n = len(mine)
        hits = sum(right(found.true[c], found.said[c][""]) for c in mine) / n
        before = sum(found.said[c][""].p for c in mine) * getattr(settings, f"{sort}_right") / n
        after = sum(found.said[c][""].p * by_others[c][sort] for c in mine) / n
        lines.append(f"{sort:<8} {n:>5} {hits:>6.2f} {before:>6.2f} {after:>11.2f} {share:>10.2f}")
    return "\n".join(lines)


CONSTANTS = Path(__file__).parents[2] / "smad" / "gap" / "decision.toml"


def as_toml(constants: Mapping[str, float], shares: Mapping[str, float], source: str) -> str:
    """The file of constants."""
    head = (
        "# Constants of a diagnosis's decision; smad/gap/settings.py says what each means.\n"
        f"# Written by `python -m evaluation decide` from {source}.\n"
    )
    tables = {"decision": constants, "right": shares}
    body = (
        f"\n[{name}]\n" + "".join(f"{k} = {float(v)!r}\n" for k, v in values.items())
        for name, values in tables.items()
    )
    return head + "".join(body)


@contextlib.contextmanager
def readied(task: Task) -> Iterator[Prepared]:
    """A case as far as it goes before effects are sought, while its replays have their thread."""
    runs, how = read_case(task.bank, task.case), task.how
    with ThreadPoolExecutor(max_workers=1) as one:
        yield ready(
            runs.fit,
            plant=how.plant(),
            good=runs.good,
            hold_out=runs.hold_out,
            settings=how.settings,
            executor=one,
        )


def answers(prepared: Prepared, grid: Mapping[str, Sequence[float]]) -> dict[str, Answer]:
    """The answer of the case as it is (""), and with each constant at the values of a grid."""
    settings = prepared.settings
    library = prepared.plant.effects
    with _asked_once(settings):
        track = follow_tracks(prepared, library)
        numbers = weigh(prepared, track)
        usual = _way(track)
        out = {"": _answer(prepared, track, settings, numbers)}
        for name, values in grid.items():
            for value in values:
                if value == getattr(settings, name):
                    continue
                with _set(settings, name, value):
                    other = follow_tracks(prepared, library)
                    same = _way(other) == usual and name not in _WEIGHED
                    given = numbers if same else weigh(prepared, other)
                    out[f"{name}={value:g}"] = _answer(prepared, other, settings, given)
    return out


_WEIGHED = frozenset(("odds", "form_share"))
"""Constants that the numbers of a finished selection depend on."""


def _answer(prepared: Prepared, track: Track, settings: Settings, numbers: Any) -> Answer:
    bare = replace(settings, quiet_right=1.0, named_right=1.0, unsure_right=1.0)
    outcome, p = decide(numbers, bare)
    if outcome in NAMED and _bounded(track.selection.best.fit):
        outcome, p = Outcome.UNKNOWN, 1.0
    if outcome not in NAMED:
        return Answer(outcome, p=p)
    names = numbers.effects
    group = tuple(n for e in names[:1] for n in numbers.groups.get(e, ()))
    return Answer(outcome, names, group, numbers.imitated, p)


def _bounded(fit: Any) -> bool:
    return bool(ending_at_bound(polished(fit.recalibrated())))


def _way(track: Track) -> tuple[object, ...]:
    s = track.selection
    fits = [id(c.fit) for c in (s.base, s.best, *s.steps, track.asked.best, track.asked.base)]
    rivals = [(n, [id(c.fit) for c in r]) for n, r in sorted(s.rivals.items())]
    return (*fits, str(rivals), track.tied, track.imitated)


@contextlib.contextmanager
def _set(settings: Settings, name: str, value: float) -> Iterator[None]:
    """Changes a constant where it is: everything that was prepared holds the same settings."""
    before = getattr(settings, name)
    object.__setattr__(settings, name, value)
    try:
        yield
    finally:
        object.__setattr__(settings, name, before)


@contextlib.contextmanager
def _asked_once(settings: Settings) -> Iterator[None]:
    """What the selection calculates is calculated once, whatever the thresholds make of it."""
    from smad.gap.compare import contrast, select

    judge_all = vars(select)["judge"]
    one = _kept(lambda fit, hold: judge_all([fit], hold)[0])

    def judge(fits: Sequence[Any], hold: Any) -> list[Any]:
        return [one(fit, hold) for fit in fits]

    about = Doubt.about
    doubts = _kept(lambda fit, judged, share: about(fit, judged))
    with contextlib.ExitStack() as stack:
        for module, name, function in (
            (select, "judge", judge),
            (contrast, "judge", judge),
            *((select, name, _kept(getattr(select, name))) for name in _SELECTING),
            (contrast, "as_in_good_runs", _kept(contrast.as_in_good_runs)),
            (Doubt, "about", staticmethod(lambda f, j: doubts(f, j, settings.form_share))),
        ):
            stack.enter_context(mock.patch.object(module, name, function))
        stack.enter_context(mock.patch(f"{__name__}.polished", _kept(polished)))
        yield


_SELECTING = ("joint_fits", "probe", "reprobe", "screen", "regime_gains")


def _kept(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, which answers the same question twice from memory; objects by identity."""
    known: dict[object, tuple[object, Any]] = {}

    def asked(*args: Any, **options: Any) -> Any:
        key = (_known_by(args), _known_by(options))
        if key not in known:
            # With what was asked of, so that its identity stays its own.
            known[key] = ((args, options), function(*args, **options))
        return known[key][1]

    return asked


def _known_by(value: Any) -> object:
    match value:
        case str() | int() | float() | None:
            return value
        case Effect():
            return value.name
        case Start():
            return (_known_by(value.effects), _known_by(value.values), value.from_centre)
        case dict():
            return tuple((k, _known_by(v)) for k, v in value.items())
        case list() | tuple():
            return tuple(_known_by(v) for v in value)
    return id(value)
