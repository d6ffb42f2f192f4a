"""Why the right name was not given: one of a few reasons, tested in a fixed order.

Pure: from what is true of a case, what was said of it, and how the right entry fares alone, to a
reason, and counts of them (tables are in `reason_tables`). The first test that holds is the reason;
every other that holds as well is told beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import msgspec

from smad.gap.check.key import STRENGTHS, CaseKey
from smad.gap.check.names import NAMING
from smad.gap.check.score import Pair, name_credit
from smad.gap.records import Outcome
from smad.gap.settings import Settings, enough_d2
from tests.withheld.entry import Apart, EntryRecord, Fit

FORMAT = "smad-why-2"


class Told(msgspec.Struct, frozen=True):
    """A case with one effect: the truth, what was said, and how the right entry fares alone.

    `credit` is the case's part of *right name first*; `given` are the names that were given beside
    the right one or in its place. `true_floors` is the largest gap of a signal, in the bank's
    floors, `true_background` the largest in what the model is trusted to since the good runs. Both
    come from the key, so that they do not depend on the entry. `entry` is None where the library
    has none for the cause.
    """

    case: str
    cause: str
    strength: float
    outcome: str
    said: list[str]
    given: list[str]
    credit: float
    true_floors: float
    true_background: float
    entry: EntryRecord | None
    judged: float

    @property
    def apart(self) -> list[Apart]:
        """The experiments that would best tell the right entry from the name given, or none."""
        if self.entry is None:
            return []
        given = self.entry.rivals[0].apart if self.entry.rivals else []
        return given or self.entry.apart


def given_beside(pair: Pair) -> list[str]:
    """Names that a verdict gives and that are not the truth, most probable first."""
    if pair.said.outcome not in NAMING:
        return []
    names = dict.fromkeys([*pair.said.first, *pair.said.group])
    return [n for n in names if n not in pair.truth.names]


def told(pair: Pair, entry: EntryRecord | None, judged: float) -> Told:
    """A pair of truth and verdict beside the numbers of the right entry."""
    naming = pair.said.outcome in NAMING
    return Told(
        case=pair.case,
        cause=pair.truth.effects[0].name,
        strength=pair.truth.strength,
        outcome=pair.said.outcome,
        said=sorted({*pair.said.first, *pair.said.group}) if naming else [],
        given=given_beside(pair),
        credit=name_credit(pair),
        true_floors=pair.truth.gap_worst,
        true_background=0.0 if entry is None else in_background(pair.truth, entry.background),
        entry=entry,
        judged=judged,
    )


def in_background(truth: CaseKey, background: Mapping[str, float]) -> float:
    """Largest gap of a signal that the key tells, in units of what that channel is trusted to."""
    return max(
        (
            gap * truth.floor.get(channel, 0.0) / background[channel]
            for channel, gap in truth.gap.items()
            if background.get(channel, 0.0) > 0.0
        ),
        default=0.0,
    )


Test = Callable[[Told, EntryRecord, Settings], bool]


@dataclass(frozen=True)
class Reason:
    """A reason, what it means, and the test of it. A case with no entry meets none of the tests."""

    name: str
    meaning: str
    holds: Test


def _rightly(t: Told, e: EntryRecord, s: Settings) -> bool:
    return t.credit >= 1.0


def _misfit(t: Told, e: EntryRecord, s: Settings) -> bool:
    # A bench whose gap stands out by itself has one whatever the effect is; an entry that did not
    # come in is to blame only if the effect is large enough to be that gap.
    entered = e.fit is not None and e.fit.enters
    return e.standing.outcome_asked is Outcome.UNKNOWN and (entered or t.true_background >= 1.0)


def _shows(e: EntryRecord, s: Settings) -> bool:
    # A gain can come from the parameters alone, which a joint fit takes further than the refit did.
    return e.fit is not None and e.fit.shows and e.fit.d2_nothing >= enough_d2(s.odds)


def _masked(t: Told, e: EntryRecord, s: Settings) -> bool:
    if e.standing.free_answers and (_shows(e, s) or t.true_background >= 1.0):
        return True
    if _shows(e, s):
        return False
    # What is d² once the parameters have followed, and what it would be if they stood still: of the
    # fitted effect, and of a typical one, since parameters may have taken a fit's strength away.
    after = [e.visible**2] if e.fit is None else [e.fit.d2_nothing, e.visible**2]
    typical = e.visible**2 / max(1.0 - e.masked, 1e-9)
    before = [typical] if e.fit is None else [e.fit.d2_known, typical]
    limit = enough_d2(s.odds)
    return any(a < limit <= b for a, b in zip(after, before, strict=True))


def _below(t: Told, e: EntryRecord, s: Settings) -> bool:
    return not _shows(e, s)


def _before(t: Told, e: EntryRecord, s: Settings) -> bool:
    return e.fit is not None and _shows(e, s) and not e.fit.enters


def _alike(t: Told, e: EntryRecord, s: Settings) -> bool:
    odds = s.odds
    return any(
        (r.d2 is not None and r.d2 < enough_d2(s.odds))
        or (r.odds is not None and 1.0 / odds < r.odds < odds)
        for r in e.rivals
    )


def _beside(t: Told, e: EntryRecord, s: Settings) -> bool:
    return t.cause in t.said


def _otherwise(t: Told, e: EntryRecord, s: Settings) -> bool:
    return True


ABSENT = Reason("not in the library", "no entry of the library is this cause", _otherwise)
REASONS = (
    Reason("named rightly", "nothing stood in the way", _rightly),
    Reason(
        "no entry fits",
        "a gap stands out, and the right entry beside the tied parameters takes too little of it: "
        "the law of the bench has another form",
        _misfit,
    ),
    Reason(
        "masked by the refit",
        "parameters explain the runs as well as the entry does, or better",
        _masked,
    ),
    Reason(
        "below the background",
        "what the entry gains is within what the model leaves of known-good runs",
        _below,
    ),
    Reason(
        "there before",
        "the known-good runs ask for the same value of the entry: it is not a change",
        _before,
    ),
    Reason(
        "not separable",
        "the name that was given and the right one explain these runs alike",
        _alike,
    ),
    Reason(
        "named with another",
        "the right name was given, and another beside it for what its form leaves",
        _beside,
    ),
    Reason(
        "passed over",
        "the right entry alone would have been named: the method chose otherwise",
        _otherwise,
    ),
)
"""Every reason, in the order in which they are tested; the last holds of whatever is left."""


def reasons_of(t: Told, settings: Settings) -> list[str]:
    """The reason, and after it the others that hold as well."""
    entry = t.entry
    if entry is None:
        return [ABSENT.name]
    held = [r.name for r in REASONS[:-1] if r.holds(t, entry, settings)]
    return held or [REASONS[-1].name]


class Explained(msgspec.Struct, frozen=True):
    """A case with its reason; `also` are the later reasons that hold as well."""

    told: Told
    reason: str
    also: list[str]


class Report(msgspec.Struct, frozen=True):
    """What stands in the way, case by case and counted: reason → strength → cases.

    `failed` are cases that could not be diagnosed once more.
    """

    format: str
    bank: str
    key_sha256: str
    verdicts_sha256: str
    meanings: dict[str, str]
    counts: dict[str, dict[str, int]]
    cases: list[Explained]
    failed: list[str] = []

    def to_json(self) -> bytes:
        """Indented JSON."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1) + b"\n"


def explained(tellings: Sequence[Told], settings: Settings) -> list[Explained]:
    """Each case with its reason, grouped by reason in the table's order, then by cause."""
    found = []
    for t in tellings:
        first, *also = reasons_of(t, settings)
        found.append(Explained(t, first, also))
    order = [ABSENT.name, *(r.name for r in REASONS)]
    return sorted(found, key=lambda x: (order.index(x.reason), x.told.cause, x.told.case))


def meanings() -> dict[str, str]:
    """What each reason means."""
    return {r.name: r.meaning for r in (ABSENT, *REASONS)}


@dataclass(frozen=True)
class Way:
    """The experiments that together should have the right entry named; if not `enough`, all known.

    `counted` is the separation that they bring from the name that was given, or from none; `errors`
    what the entry's gain should come to with them, in its standard errors.
    """

    experiments: list[str]
    counted: float
    errors: float
    enough: bool


def parting(t: Told, settings: Settings) -> Way | None:
    """The way to a name; None where nothing was fitted.

    As many of the best experiments as tell the entry from what was said, and raise its gain to the
    standard errors that are asked of it.
    """
    if t.entry is None or t.entry.fit is None or not t.apart:
        return None
    every = list(dict.fromkeys(a.experiment for a in (*t.apart, *t.entry.apart)))
    ways = [_way(t, t.entry, every[:n], settings) for n in range(1, len(every) + 1)]
    return next((way for way in ways if way.enough), ways[-1])


def _way(t: Told, entry: EntryRecord, experiments: list[str], settings: Settings) -> Way:
    assert entry.fit is not None
    counted = sum(a.counted for a in t.apart if a.experiment in experiments)
    more = sum(a.d2 for a in entry.apart if a.experiment in experiments)
    errors = raised(entry.fit, more, t.judged)
    enough = counted >= enough_d2(settings.odds) and errors >= entry.fit.asked
    return Way(experiments, counted, errors, enough)


def raised(fit: Fit, more: float, judged: float) -> float:
    """Standard errors that a gain comes to with runs that separate the entry by `more`.

    The gain grows as the separation does, its variance likewise: z √(1 + r), r being `more` over
    the separation of all runs that are judged, `judged` times as many as are fitted.
    """
    if fit.gain <= 0.0 or fit.gain_se <= 0.0 or fit.d2_nothing <= 0.0:
        return 0.0
    return fit.gain / fit.gain_se * math.sqrt(1.0 + more / (judged * fit.d2_nothing))


def parted(x: Explained, settings: Settings) -> bool:
    """Whether the best few experiments together should have it named."""
    way = parting(x.told, settings)
    return way is not None and way.enough


def counts(cases: Sequence[Explained]) -> dict[str, dict[str, int]]:
    """Reason → strength in floors → number of cases; only reasons that were met."""
    out: dict[str, dict[str, int]] = {}
    for x in cases:
        by_strength = out.setdefault(x.reason, {f"{s:.0f}×": 0 for s in STRENGTHS})
        by_strength[f"{x.told.strength:.0f}×"] += 1
    return out
