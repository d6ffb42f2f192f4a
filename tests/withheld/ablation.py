"""What each threshold of the verdict changes: every one is dropped in turn, on a development bank.

    python -m tests.withheld ablate BANK KEY --out FOLDER [--cases case-001,…]

A threshold is dropped by the value at which it never acts. A case is asked again with it: what does
not depend on it is worked out once, so that only another way through the selection costs fits.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

from smad.gap.check.bank import chosen, open_bank
from smad.gap.check.case import How, Task, source_digest
from smad.gap.check.key import CaseKey, read_key
from smad.gap.compare.tracks import Track, follow_tracks
from smad.gap.compare.verdict import decide
from smad.gap.compare.weigh import weigh
from smad.gap.fit.candidate import ending_at_bound
from smad.gap.fit.doubt import Doubt
from smad.gap.fit.joint import Start, polished
from smad.gap.fit.stages import Prepared
from smad.gap.plant import Effect
from smad.gap.records import NAMED, Outcome
from smad.gap.settings import Settings
from tests.withheld.seals import refuse_sealed
from tests.withheld.second_pass import readied

_NEVER = 1e9
DROPPED: dict[str, dict[str, float]] = {
    "significance": {"significance": 1.0},
    "since_gain": {"since_gain": 0.0},
    "standard_errors, 0": {"standard_errors": 0.0},
    "standard_errors, never": {"standard_errors": _NEVER},
    "min_shrink_gain": {"min_shrink_gain": -_NEVER},
    "imitated_share": {"imitated_share": _NEVER},
    "imitated_gain": {"imitated_gain": 0.0},
    "vanished_share": {"vanished_share": _NEVER},
    "unknown_shrink": {"unknown_shrink": -_NEVER},
    "unknown_ratio": {"unknown_ratio": -_NEVER},
    "since_spreads": {"since_spreads": _NEVER},
    "lone_ratio": {"lone_ratio": _NEVER},
    "least_visible": {"least_visible": -1.0},
    "rest_margin": {"rest_margin": _NEVER},
    "ambiguous_odds": {"ambiguous_odds": 0.0},
    "ambiguous_d2": {"ambiguous_d2": 0.0},
    "form_share": {"form_share": 0.0},
}
"""What is dropped → the settings with which it never acts."""


@dataclasses.dataclass(frozen=True)
class Answer:
    """What a verdict says, without its probability."""

    outcome: str
    names: tuple[str, ...]
    group: tuple[str, ...]

    def __str__(self) -> str:
        names = " + ".join(self.names)
        named = " or ".join([names, *self.group]) if names else ""
        return f"{self.outcome}: {named}" if named else self.outcome


def ablate(bank: Path, key: Path, out: Path, cases: Sequence[str] = ()) -> None:
    """Asks every case with every threshold dropped; prints what that changes.

    Raises BankError for a sealed key.
    """
    refuse_sealed(key.parent)
    truth, _ = read_key(key)
    opened = open_bank(bank)
    out.mkdir(parents=True, exist_ok=True)
    found: dict[str, dict[str, str]] = {}
    for case in chosen(opened, only=cases):
        kept = out / f"{case.id}.json"
        if not kept.exists():
            task = Task(opened, case, How(), source_digest())
            with readied(task, task.how) as prepared:
                said = {k: str(v) for k, v in answers(prepared).items()}
            kept.write_text(json.dumps(said, indent=1))
        found[case.id] = json.loads(kept.read_text())
        print(f"{case.id}  {_true(truth.cases[case.id])}  →  {found[case.id]['']}", flush=True)
    print(table(found))


def table(found: Mapping[str, Mapping[str, str]]) -> str:
    """A line for each threshold: in how many cases the verdict changes without it, and to what."""
    lines = []
    for name in DROPPED:
        changed = [
            f"{case}: {said['']} → {said[name]}"
            for case, said in found.items()
            if said[name] != said[""]
        ]
        lines.append(f"{name:<30} {len(changed):>2} of {len(found)}  {'; '.join(changed)}")
    return "\n".join(lines)


def _true(case: CaseKey) -> str:
    return f"{case.kind} {' + '.join(sorted(case.names))} at {case.gap_worst:.1f}"


def answers(prepared: Prepared) -> dict[str, Answer]:
    """The answer of the case as it is (""), and with each threshold dropped."""
    settings = prepared.settings
    library = prepared.plant.effects
    with _asked_once(settings):
        track = follow_tracks(prepared, library)
        numbers = weigh(prepared, track)
        usual = _way(track)
        out = {"": _answer(prepared, track, settings)}
        for name, values in DROPPED.items():
            with _set(settings, values):
                other = follow_tracks(prepared, library)
                same = _way(other) == usual and not values.keys() & _WEIGHED
                out[name] = _answer(prepared, other, settings, numbers if same else None)
    return out


_WEIGHED = frozenset(("ambiguous_odds", "ambiguous_d2"))
"""Settings that the numbers of a finished selection depend on."""


def _answer(prepared: Prepared, track: Track, settings: Settings, numbers: Any = None) -> Answer:
    numbers = numbers or weigh(prepared, track)
    outcome, _ = decide(numbers, settings)
    if outcome in NAMED and _bounded(track.selection.best.fit):
        outcome = Outcome.UNKNOWN
    names = numbers.effects if outcome in NAMED else ()
    group = tuple(n for e in names[:1] for n in numbers.groups.get(e, ()))
    return Answer(f"{outcome}{', imitated' if numbers.imitated and names else ''}", names, group)


def _bounded(fit: Any) -> bool:
    return bool(ending_at_bound(polished(fit.recalibrated())))


def _way(track: Track) -> tuple[object, ...]:
    s = track.selection
    fits = [id(c.fit) for c in (s.base, s.best, *s.steps, track.asked.best, track.asked.base)]
    rivals = [(n, [id(c.fit) for c in r]) for n, r in sorted(s.rivals.items())]
    return (*fits, str(rivals), track.tied, track.imitated)


@contextlib.contextmanager
def _set(settings: Settings, values: Mapping[str, float]) -> Iterator[None]:
    """Changes settings where they are: everything that was prepared holds the same ones."""
    before = {name: getattr(settings, name) for name in values}
    for name, value in values.items():
        object.__setattr__(settings, name, value)
    try:
        yield
    finally:
        for name, value in before.items():
            object.__setattr__(settings, name, value)


@contextlib.contextmanager
def _asked_once(settings: Settings) -> Iterator[None]:
    """What the selection calculates is calculated once, whatever the thresholds make of it."""
    from smad.gap.compare import contrast, select

    one = _kept(lambda fit, hold: select_judge([fit], hold)[0])
    select_judge = select.judge

    def judge(fits: Sequence[Any], hold: Any) -> list[Any]:
        return [one(fit, hold) for fit in fits]

    about = Doubt.about
    doubts = _kept(lambda fit, judged, share: about(fit, judged))
    with contextlib.ExitStack() as stack:
        for module, name, function in (
            (select, "judge", judge),
            (contrast, "judge", judge),
            (select, "joint_fits", _kept(select.joint_fits)),
            (select, "probe", _kept(select.probe)),
            (select, "reprobe", _kept(select.reprobe)),
            (select, "screen", _kept(select.screen)),
            (select, "regime_gains", _kept(select.regime_gains)),
            (Prepared, "null", _kept(Prepared.null)),
            (contrast, "as_in_good_runs", _kept(contrast.as_in_good_runs)),
            (Doubt, "about", staticmethod(lambda f, j: doubts(f, j, settings.form_share))),
        ):
            stack.enter_context(mock.patch.object(module, name, function))
        stack.enter_context(mock.patch(f"{__name__}.polished", _kept(polished)))
        yield


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
