"""Constants of a check-up's decision from development banks, and what they are worth.

The rule reads a few numbers of each check-up. These are kept, and other constants are tried on them
without another replay. Limits of a quiet bench are quantiles of what quiet benches show; the odds
of laws and effects are those under which the truth is likeliest; levels are those with which what
is told is right as often as it should be. How good that is, is told by leaving out one bench after
the other.
"""

import json
import pickle
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import msgspec
import numpy as np
from scipy import optimize

from evaluation.errors import BankError
from evaluation.names import canonical
from evaluation.results.record import keep
from evaluation.run.judging import Check
from evaluation.run.manifest import read_manifest
from evaluation.score.answers import CaseKey, Key
from evaluation.score.openings import refuse_sealed
from smad.checkup.judge import Sizes, examined
from smad.checkup.paired.difference import paired
from smad.diagnosis.constants import Constants, shipped
from smad.diagnosis.search.odds import NAMED, Hypothesis, odds, of_places, told
from smad.report.page import Table

FALSE_ALARMS = 1.0 / 60.0
"""Of quiet benches, one in so many may be called changed: half of them by either limit."""
_LEAST_SHARE = 1e-9
QUIET = ("none", "room", "preload", "drift")
"""Kinds of cases in which nothing has changed."""
FORMS = tuple(float(f"{x:.3g}") for x in np.geomspace(0.005, 1.0, 107))
LEVELS = tuple(round(0.02 * k, 2) for k in range(20, 50))
HELD = 0.95
"""Share of changes of which the told places should hold the truth."""
_NEEDED = {
    "a bench without a change": QUIET,
    "a single effect": ("single", "unknown"),
    "changed parameters": ("parameters",),
}
_PENALTY = 0.05
"""Of the squares of the weights, per case of none: keeps them finite."""
_BINS = 5


@dataclass(frozen=True, kw_only=True)
class Case(Sizes):
    """What the rule reads of a check-up, in squares of rows, beside the truth.

    `hypotheses` are those of the first step.
    """

    bench: str
    truth: CaseKey
    hypotheses: tuple[Hypothesis, ...]

    def odds(self, c: Constants) -> np.ndarray:
        """The probability of each hypothesis."""
        return odds(self.hypotheses, c, c.quiet_gain)

    def places(self, c: Constants) -> dict[str, float]:
        """The probability of each place, the likeliest first."""
        return of_places(self.hypotheses, self.odds(c))

    def name(self, c: Constants) -> tuple[str, float]:
        """The likeliest effect at the likeliest place, and its probability."""
        place = next(iter(self.places(c)))
        here = [(h.effect, float(p)) for h, p in zip(self.hypotheses, self.odds(c), strict=True)
                if h.effect and h.place == place]  # fmt: skip
        return max(here, key=lambda one: one[1], default=("", 0.0))

    @cached_property
    def true_places(self) -> frozenset[str]:
        """Where the simulator can hold its effects."""
        return frozenset(p for e in self.truth.effects for p in e.places)

    @cached_property
    def placed(self) -> np.ndarray:
        """Which hypotheses lie at a right place."""
        return np.array([h.place in self.true_places for h in self.hypotheses])

    @cached_property
    def right(self) -> np.ndarray:
        """Which hypotheses are right: the effect itself where it is listed, else laws of its place.

        Where the right effect was not refined, the law of its place is the best there is.
        """
        names = {e.name for e in self.truth.effects if e.known}
        own = np.array([bool(h.effect) and canonical(h.effect) in names for h in self.hypotheses])
        laws = np.array([not h.effect and h.place in self.true_places for h in self.hypotheses])
        return own if own.any() else laws


def kept_cases(bank: Path, kept: Path, only: Sequence[str] = (), jobs: int = 1) -> list[Case]:
    """The cases of a bank, whose key is in the folder of its name with `-key` beside it; each bench
    is kept once it is examined. Raises BankError for a sealed key."""
    key = bank.with_name(f"{bank.name}-key")
    benches = read_manifest(bank).benches
    refuse_sealed(key)
    kept.mkdir(parents=True, exist_ok=True)
    wanted = only or list(benches)
    places = {bench: kept / f"{bank.name}-{bench}.pickle" for bench in wanted}
    with ProcessPoolExecutor(jobs) as pool:
        tasks = [pool.submit(_examined, bank, key, b, p) for b, p in places.items()
                 if not p.exists()]  # fmt: skip
        for done in as_completed(tasks):
            print(done.result(), flush=True)
    return [case for p in places.values() for case in pickle.loads(p.read_bytes())]


def _examined(bank: Path, key: Path, bench: str, place: Path) -> str:
    """Keeps what the rule reads of the check-ups of one bench at `place`."""
    check = Check(folder=bank, manifest=read_manifest(bank))
    truths = msgspec.json.decode((key / "KEY.json").read_bytes(), type=Key).cases
    # One step, whatever it takes.
    asked = msgspec.structs.replace(shipped(), quiet_gain=-np.inf)
    out = []
    for case in check.manifest.benches[bench]:
        runs = [(run, run.name) for run in check.runs(case, "fit")["fit"]]
        found = examined(paired(check.plant, check.reference(case), runs), asked, most=1)
        out.append(
            Case(
                bench=f"{bank.name} {bench}", truth=truths[case.id], count=found.count,
                ratio=found.ratio, gain=found.gain, explained=found.explained,
                parameters=found.parameters, hypotheses=found.located.where.steps[0].hypotheses,
            )
        )  # fmt: skip
    place.write_bytes(pickle.dumps(out))
    return f"{bank.name} {bench}: {len(out)} check-ups"


def chosen(cases: Sequence[Case], before: Constants) -> Constants:
    """The constants that these cases ask for. Raises BankError where they lack a kind."""
    for what, kinds in _NEEDED.items():
        if not any(x.truth.kind in kinds for x in cases):
            raise BankError(
                f"none of {len(cases)} check-ups is of {what}, which constants are fitted to: add a"
                " bank of the mixture `scores`, or more --benches"
            )
    c = _quiet(cases, before)
    changed = [x for x in cases if x.noticed(c)]
    tried = [msgspec.structs.replace(c, parameters_form=f) for f in FORMS]
    right = np.array([_parameters_right(changed, c) for c in tried])
    # Where several are equally good, the one in their middle.
    c = tried[int(np.median(np.flatnonzero(right >= right.max() - 1e-9)))]
    single = [x for x in changed if x.truth.kind in ("single", "unknown") and x.right.any()]
    c = _likeliest(single, c)
    return msgspec.structs.replace(c, told_level=_told_level(single, c))


def _likeliest(cases: Sequence[Case], c: Constants) -> Constants:
    """The odds of laws and effects under which the truth of these cases is likeliest.

    Where and what name are both asked: the product of the probabilities of the right places and of
    the right hypotheses counts.
    """
    names = ("effect_odds", "effect_weight", "law_weight")

    def constants(w: np.ndarray) -> Constants:
        values = zip(names, w, strict=True)
        return msgspec.structs.replace(c, **{n: float(x) for n, x in values})

    def unlikely(w: np.ndarray) -> float:
        own = constants(w)
        told = [
            np.log(p[which].sum() + 1e-300)
            for x in cases
            for p in (x.odds(own),)
            for which in (x.right, x.placed)
        ]
        return float(0.5 * _PENALTY * w @ w - np.sum(told))

    found = optimize.minimize(unlikely, np.array([getattr(c, n) for n in names]))
    return constants(np.array([_rounded(x) for x in found.x]))


def _told_level(cases: Sequence[Case], c: Constants) -> float:
    """The least level at which the told places hold the truth in `HELD` of the cases."""
    for level in LEVELS:
        held = [bool(x.true_places & set(told(x.places(c), level))) for x in cases]
        if np.mean(held) >= HELD:
            return level
    return LEVELS[-1]


def _is_of(name: str, case: Case) -> bool:
    return canonical(name) in {e.name for e in case.truth.effects}


def _parameters_right(cases: Sequence[Case], c: Constants) -> float:
    """Share of changed parameters that are told as such, and of effects that are not; their sum."""
    own = [x.of_parameters(c) for x in cases if x.truth.kind == "parameters"]
    other = [not x.of_parameters(c) for x in cases if x.truth.kind not in (*QUIET, "parameters")]
    return float(sum(np.mean(some) for some in (own, other) if some))


def _quiet(cases: Sequence[Case], before: Constants) -> Constants:
    """The limits of a quiet bench: quantiles of what quiet benches show.

    That of all rows together is no number of these benches: floors of any plant are so wide that
    its rows stay below 1.
    """
    quiet = [x for x in cases if x.truth.kind in QUIET]
    benches = [x.bench for x in quiet]
    return msgspec.structs.replace(
        before,
        quiet_variance=_rounded(float(np.median([x.ratio for x in quiet]))),
        quiet_gain=_rounded(_limit(np.array([x.gain for x in quiet]), benches)),
        quiet_parameters=_rounded(_limit(np.array([x.parameters for x in quiet]), benches)),
    )


def _limit(values: np.ndarray, benches: Sequence[str]) -> float:
    """The limit that quiet benches exceed as seldom as they should.

    Benches differ more than days of one do. So the quantile is moved outward until benches by
    limits from the others keep them.
    """
    own = np.array(benches)
    allowed = share = 0.5 * FALSE_ALARMS
    while share > _LEAST_SHARE:
        alarms = sum(
            int((values[own == b] >= _beyond(values[own != b], share)).sum()) for b in set(benches)
        )
        if alarms <= allowed * len(values):
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


def report(cases: Sequence[tuple[Case, Constants]]) -> list[tuple[str, str]]:
    """What the cases come to, each by constants of its own: rows of what, and how many."""

    def share(
        what: str, some: Sequence[tuple[Case, Constants]], test: Callable[..., bool]
    ) -> tuple[str, str]:
        return what, f"{sum(test(x, c) for x, c in some)} of {len(some)}"

    def of(*kinds: str) -> list[tuple[Case, Constants]]:
        return [(x, c) for x, c in cases if x.truth.kind in kinds]

    changed = [(x, c) for x, c in of("single", "unknown") if x.noticed(c)]
    listed = [(x, c) for x, c in changed if x.truth.kind == "single"]
    other = [(x, c) for x, c in changed if x.truth.kind == "unknown"]
    given = [(x, c) for x, c in changed if x.name(c)[1] >= NAMED]

    def named(x: Case, c: Constants) -> bool:
        name, p = x.name(c)
        return p >= NAMED and _is_of(name, x)

    def first(x: Case, c: Constants) -> bool:
        return next(iter(x.places(c))) in x.true_places

    def held(x: Case, c: Constants) -> bool:
        return bool(x.true_places & set(told(x.places(c), c.told_level)))

    sizes = [len(told(x.places(c), c.told_level)) for x, c in changed]
    return [
        share("quiet benches called changed", of(*QUIET),
              Case.noticed),
        share("parameters told as such, of noticed",
              [(x, c) for x, c in of("parameters") if x.noticed(c)],
              Case.of_parameters),
        share("effects noticed", of("single", "unknown"), Case.noticed),
        share("effects told as parameters", changed, Case.of_parameters),
        share("first place right, listed", listed, first),
        share("first place right, unlisted", other, first),
        share("told places hold the truth, listed", listed, held),
        share("told places hold the truth, unlisted", other, held),
        ("told places, mean number", f"{np.mean(sizes) if sizes else 0.0:.2f}"),
        share("right name, of noticed listed", listed, named),
        share("right name, of names given", given, named),
        share("unlisted given a name", other, lambda x, c: x.name(c)[1] >= NAMED),
        *_reliability("place", [(next(iter(x.places(c).values())), first(x, c))
                                for x, c in changed]),
        *_reliability("name", [(x.name(c)[1], _is_of(x.name(c)[0], x)) for x, c in changed]),
    ]  # fmt: skip


def _reliability(what: str, told: Sequence[tuple[float, bool]]) -> list[tuple[str, str]]:
    """How often what had a probability was right: the reliability diagram as a table."""
    out = []
    for k in range(_BINS):
        low, high = k / _BINS, (k + 1) / _BINS
        own = [(p, right) for p, right in told if low <= p < high or (p == high == 1.0)]
        if own:
            mean = float(np.mean([p for p, _ in own]))
            right = sum(right for _, right in own)
            out.append((f"{what} with probability {mean:.2f}", f"{right} of {len(own)}"))
    return out


def calibrate(
    banks: Sequence[Path],
    kept: Path,
    out: Path | None,
    benches: Sequence[str] = (),
    *,
    jobs: int = 1,
    result: Path | None = None,
) -> Constants:
    """The constants of banks: prints what the shipped ones, the new ones, and for each bench those
    of the others come to. `out` is where the new ones go as TOML; `result` keeps what the benches
    come to by constants of the others."""
    before = shipped()
    cases = [x for bank in banks for x in kept_cases(bank, kept, benches, jobs)]
    after = chosen(cases, before)
    held = []
    for bench in sorted({x.bench for x in cases}):
        own = chosen([x for x in cases if x.bench != bench], before)
        held += [(x, own) for x in cases if x.bench == bench]
    names = ", ".join(b.name for b in banks)
    for title, some in (
        ("before", [(x, before) for x in cases]),
        ("each bench by constants from the others", held),
        ("after, on the benches they come from", [(x, after) for x in cases]),
    ):
        print(f"{title}:", *(f"  {what:<44} {value}" for what, value in report(some)), sep="\n")
    if result is not None:
        table = Table(("what", "cases"), report(held), numeric=frozenset({1}))
        note = f"{len(cases)} check-ups of {names}; each bench by constants from the others."
        keep(result, {"": table}, title="Check-ups of development banks, benches left out",
             command="python -m evaluation calibrate", note=note)  # fmt: skip
    for name in before.__struct_fields__:
        if getattr(before, name) != getattr(after, name):
            print(f"  {name:<18} {getattr(before, name):>8g} -> {getattr(after, name):g}")
    if out is not None:
        out.write_text(_toml(after, names, len(cases)))
        print(f"written: {out}")
    return after


def _toml(constants: Constants, banks: str, cases: int) -> str:
    head = (
        "# Constants of where, law and name; smad/diagnosis/constants.py says what each means.\n"
        f"# Written by `python -m evaluation calibrate` from {cases} check-ups of {banks}.\n"
    )
    return head + "".join(
        f"{name} = {json.dumps(getattr(constants, name))}\n" for name in constants.__struct_fields__
    )
