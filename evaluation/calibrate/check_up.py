"""Constants of a check-up's decision from development banks, and what they are worth.

The rule reads a few numbers of each check-up. These are kept, and other constants are tried on them
without another replay. Limits of a quiet bench are quantiles of what quiet benches show; the others
are those with which most cases are told right. How good that is, is told by leaving out one bench
after the other.
"""

import json
import pickle
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import msgspec
import numpy as np

from evaluation.names import canonical
from evaluation.run.check_ups import benches_of, manifest_of
from evaluation.score.answers import CaseKey, Key
from evaluation.score.openings import refuse_sealed
from smad.checkup.judge import examined
from smad.checkup.paired.difference import paired
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.spring_pair import SmaPlant

FALSE_ALARMS = 1.0 / 60.0
"""Of quiet benches, one in so many may be called changed."""
_LEAST_SHARE = 1e-9
QUIET = ("none", "room", "preload", "drift")
"""Kinds of cases in which nothing has changed."""
ENTRY_SHARES = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)
NAMES = tuple(product((0.9, 0.8, 0.75, 0.7, 0.6, 0.5), (0.5, 0.4, 0.35, 0.3, 0.25, 0.2, 0.1)))
"""Candidates of `name_share` and `name_size`; of two as good the first, which claims less."""
TRUSTED = (0.0, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.02, 0.05, 0.1)
WRONG = 2.0
"""A wrong name costs as much as so many right ones are worth."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """What the rule reads of a check-up, in squares of rows, beside the truth.

    `laws` is what the best law of each place takes; `entry` the effect that takes most,
    `entry_gain` what it takes, `acts` where it acts.
    """

    bench: str
    truth: CaseKey
    square: float
    count: int
    ratio: float
    gain: float
    parameters: float
    beside_parameters: float
    laws: dict[str, float]
    entry: str
    entry_gain: float
    acts: frozenset[str]

    def noticed(self, c: Constants) -> bool:
        """Whether it stands out of the repeat floor."""
        return max(self.gain, self.parameters) >= c.quiet_gain or self.ratio >= c.quiet_ratio

    def size(self, c: Constants) -> float:
        """What shares are of."""
        return max(self.square - c.quiet_variance * self.count, self.gain)

    def place(self, c: Constants) -> str:
        """The first place."""
        own = {p: g for p, g in self.laws.items() if p in self.acts}
        by_entry = own and self.entry_gain >= c.entry_share * self.gain
        among = own if by_entry else self.laws
        return max(among, key=lambda p: among[p])

    def name(self, c: Constants) -> str:
        """The name, empty for none."""
        enough = self.entry_gain >= max(c.name_share * self.gain, c.name_size * self.size(c))
        return self.entry if enough else ""

    def parameters_first(self, c: Constants) -> bool:
        """Whether other values of the parameters are the answer."""
        left = self.square - max(self.gain, self.entry_gain)
        trusted = left + c.slopes_trusted * self.parameters
        return self.parameters >= c.quiet_gain and self.beside_parameters <= trusted


def kept_cases(bank: Path, kept: Path, only: Sequence[str] = (), jobs: int = 1) -> list[Case]:
    """The cases of a bank, whose key is in the folder of its name with `-key` beside it; each bench
    is kept once it is examined. Raises BankError for a sealed key."""
    key = bank.with_name(f"{bank.name}-key")
    manifest = manifest_of(bank)
    refuse_sealed(key)
    kept.mkdir(parents=True, exist_ok=True)
    wanted = only or sorted({c["bench"] for c in manifest["cases"]})
    places = {bench: kept / f"{bank.name}-{bench}.pickle" for bench in wanted}
    with ProcessPoolExecutor(jobs) as pool:
        tasks = [pool.submit(_examined, bank, key, b, p) for b, p in places.items()
                 if not p.exists()]  # fmt: skip
        for done in as_completed(tasks):
            print(done.result(), flush=True)
    return [case for p in places.values() for case in pickle.loads(p.read_bytes())]


def _examined(bank: Path, key: Path, bench: str, place: Path) -> str:
    """Keeps what the rule reads of the check-ups of one bench at `place`."""
    plant = SmaPlant()
    truths = msgspec.json.decode((key / "KEY.json").read_bytes(), type=Key).cases
    # One step, whatever it takes, with the effect that takes most of all.
    asked = msgspec.structs.replace(
        shipped(), most_places=1, place_share=0.0, quiet_gain=0.0, entry_share=0.0
    )
    ((_, reference, cases),) = benches_of(bank, manifest_of(bank), plant, only=[bench])
    out = []
    for case, runs in cases:
        found = examined(paired(plant, reference, runs), asked)
        w, rows = found.located.where, found.located.rows
        laws: dict[str, float] = {}
        for s in w.ranked:
            laws.setdefault(s.candidate.place, s.share * w.size)
        entry = w.steps[0].entry if w.steps else None
        out.append(
            Case(
                bench=f"{bank.name} {bench}", truth=truths[case], square=rows.square,
                count=rows.count, ratio=found.ratio, gain=found.gain,
                parameters=found.parameters, beside_parameters=found.beside_parameters, laws=laws,
                entry=entry.names[0] if entry else "", entry_gain=entry.gain if entry else 0.0,
                acts=frozenset(entry.effects[0].places) if entry else frozenset(),
            )
        )  # fmt: skip
    place.write_bytes(pickle.dumps(out))
    return f"{bank.name} {bench}: {len(out)} check-ups"


def chosen(cases: Sequence[Case], before: Constants) -> Constants:
    """The constants with which most of the cases are told right."""
    c = _quiet(cases, before)
    changed = [x for x in cases if x.noticed(c)]
    single = [x for x in changed if x.truth.kind in ("single", "unknown")]
    c = _best(c, [{"slopes_trusted": t} for t in TRUSTED], lambda c: _parameters_right(changed, c))
    c = _best(c, [{"entry_share": s} for s in ENTRY_SHARES], lambda c: _placed(single, c))
    names = [{"name_share": s, "name_size": z} for s, z in NAMES]
    return _best(c, names, lambda c: _named(single, c))


def _best(
    c: Constants, changes: Iterable[dict[str, float]], worth: Callable[[Constants], float]
) -> Constants:
    tried = [msgspec.structs.replace(c, **change) for change in changes]
    return max(tried, key=worth)


def _parameters_right(cases: Sequence[Case], c: Constants) -> float:
    """How many changes of parameters are told as such, and effects are not."""
    return float(sum(x.parameters_first(c) == (x.truth.kind == "parameters") for x in cases))


def _placed(cases: Sequence[Case], c: Constants) -> float:
    return float(sum(x.place(c) in {p for e in x.truth.effects for p in e.places} for x in cases))


def _named(cases: Sequence[Case], c: Constants) -> float:
    """Right names, less what wrong ones cost."""
    worth = 0.0
    for x in cases:
        if name := canonical(x.name(c)):
            right = name in {e.name for e in x.truth.effects}
            worth += 1.0 if right else -WRONG
    return worth


def _quiet(cases: Sequence[Case], c: Constants) -> Constants:
    """The limit of a quiet bench: a quantile of what quiet benches show.

    That of all rows together is no number of these benches: floors of any plant are so wide that
    its rows stay below 1.
    """
    quiet = [x for x in cases if x.truth.kind in QUIET]
    benches = [x.bench for x in quiet]
    gains = np.array([max(x.gain, x.parameters) for x in quiet])
    return msgspec.structs.replace(
        c,
        quiet_variance=_rounded(float(np.median([x.ratio for x in quiet]))),
        quiet_gain=_rounded(_limit(gains, benches)),
    )


def _limit(values: np.ndarray, benches: Sequence[str]) -> float:
    """The limit that quiet benches exceed as seldom as they should.

    Benches differ more than days of one do. So the quantile is moved outward until benches by
    limits from the others keep them.
    """
    own = np.array(benches)
    share = FALSE_ALARMS
    while share > _LEAST_SHARE:
        alarms = sum(
            int((values[own == b] >= _beyond(values[own != b], share)).sum()) for b in set(benches)
        )
        if alarms <= FALSE_ALARMS * len(values):
            break
        share /= 2.0
    return _beyond(values, share)


def _beyond(values: np.ndarray, share: float) -> float:
    """What a share of such values exceeds, where what exceeds their median falls off exponentially.

    The tail decides, and the lower half says nothing of it: "peaks over threshold" with the
    exponential of the generalised Pareto family (Pickands 1975).
    """
    middle = float(np.median(values))
    mean_excess = float(np.mean(values[values > middle] - middle)) if len(values) > 1 else middle
    return middle + mean_excess * float(np.log(0.5 / share))


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")


def report(cases: Sequence[tuple[Case, Constants]]) -> list[str]:
    """What the cases come to, each by constants of its own."""

    def share(what: str, some: Sequence[tuple[Case, Constants]], test: Callable[..., bool]) -> str:
        return f"  {what:<44} {sum(test(x, c) for x, c in some):>4} of {len(some)}"

    def of(*kinds: str) -> list[tuple[Case, Constants]]:
        return [(x, c) for x, c in cases if x.truth.kind in kinds]

    changed = [(x, c) for x, c in of("single", "unknown") if x.noticed(c)]
    listed = [(x, c) for x, c in changed if x.truth.kind == "single"]
    other = [(x, c) for x, c in changed if x.truth.kind == "unknown"]
    given = [(x, c) for x, c in changed if x.name(c)]

    def right(x: Case, c: Constants) -> bool:
        return canonical(x.name(c)) in {e.name for e in x.truth.effects}

    def placed(x: Case, c: Constants) -> bool:
        return _placed([x], c) > 0.0

    return [
        share("quiet benches called changed", of(*QUIET),
              lambda x, c: x.noticed(c)),
        share("parameters told as such, of noticed",
              [(x, c) for x, c in of("parameters") if x.noticed(c)],
              lambda x, c: x.parameters_first(c)),
        share("effects noticed", of("single", "unknown"), lambda x, c: x.noticed(c)),
        share("effects told as parameters", changed, lambda x, c: x.parameters_first(c)),
        share("first place right, listed", listed, placed),
        share("first place right, unlisted", other, placed),
        share("right name, of noticed listed", listed, right),
        share("right name, of names given", given, right),
        share("unlisted given a name", other, lambda x, c: bool(x.name(c))),
    ]  # fmt: skip


def calibrate(
    banks: Sequence[Path],
    kept: Path,
    out: Path | None,
    benches: Sequence[str] = (),
    *,
    jobs: int = 1,
) -> Constants:
    """The constants of banks: prints what the shipped ones, the new ones, and for each bench those
    of the others come to. `out` is where the new ones go as TOML."""
    before = shipped()
    cases = [x for bank in banks for x in kept_cases(bank, kept, benches, jobs)]
    after = chosen(cases, before)
    held = []
    for bench in sorted({x.bench for x in cases}):
        own = chosen([x for x in cases if x.bench != bench], before)
        held += [(x, own) for x in cases if x.bench == bench]
    for title, some in (
        ("before", [(x, before) for x in cases]),
        ("each bench by constants from the others", held),
        ("after, on the benches they come from", [(x, after) for x in cases]),
    ):
        print(f"{title}:", *report(some), sep="\n")
    for name in before.__struct_fields__:
        if getattr(before, name) != getattr(after, name):
            print(f"  {name:<18} {getattr(before, name):>8g} -> {getattr(after, name):g}")
    if out is not None:
        out.write_text(_toml(after, ", ".join(b.name for b in banks), len(cases)))
        print(f"written: {out}")
    return after


def _toml(constants: Constants, banks: str, cases: int) -> str:
    head = (
        "# Constants of where, law and name; smad/diagnosis/constants.py says what each means.\n"
        "# Those of check-ups and names were written by `python -m evaluation calibrate`\n"
        f"# from {cases} check-ups of {banks}.\n"
    )
    return head + "".join(
        f"{name} = {json.dumps(getattr(constants, name))}\n" for name in constants.__struct_fields__
    )
