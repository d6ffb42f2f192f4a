"""What a diagnosis says, as records that go to JSON as they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from smad.diagnosis.errors import PlantMismatch

QUIET, PARAMETERS, CAUSES, UNEXPLAINED, REFUSED = (
    "quiet", "parameters", "causes", "unexplained", "refused",
)  # fmt: skip
OUTCOMES = (QUIET, PARAMETERS, CAUSES, UNEXPLAINED, REFUSED)
"""Nothing beyond the floor; other values of the parameters explain it; causes are told; more than
the parameters is missing, and no rival brings the judged runs nearer; no verdict."""
DIFFERS, CHANGED, CHECK_UP = "differs", "changed", "check-up"


class Finding(msgspec.Struct, frozen=True):
    """Something about a run. `kind` is a word to tell it by; `refuses` ends the run."""

    run: str
    kind: str
    text: str
    refuses: bool


class RunRecord(msgspec.Struct, frozen=True):
    """A run that was given. `role` is fit, hold-out, good or refused."""

    name: str
    role: str
    duration_s: float
    sha256: str


class LawTerm(msgspec.Struct, frozen=True, kw_only=True):
    """A term of a law: what it goes with in `words`, its `slopes` by spring with their standard
    deviations `sd`, in `unit`. `state` is the state's name."""

    name: str
    state: str
    words: str
    slopes: dict[str, float]
    sd: dict[str, float]
    unit: str

    @property
    def text(self) -> str:
        """What it goes with and how, as users read it."""
        slopes = ", ".join(
            f"{'' if side == 'both' else side.upper() + ' '}{v:+.2g} ± {self.sd[side]:.1g}"
            for side, v in self.slopes.items()
        )
        return f"{self.words}: {slopes}{'' if self.unit == '1' else ' ' + self.unit}"


class EffectValue(msgspec.Struct, frozen=True, kw_only=True):
    """A parameter of an effect with its standard deviation, in `unit`."""

    name: str
    value: float
    sd: float
    unit: str

    @property
    def text(self) -> str:
        """As users read it: tau_s = 0.600 ± 0.002 s."""
        digits = max(len(f"{self.value:.3g}"), 1) and 3
        unit = "" if self.unit == "1" else f" {self.unit}"
        return f"{self.name} = {self.value:.{digits}g} ± {self.sd:.1g}{unit}"


class RivalGap(msgspec.Struct, frozen=True, kw_only=True):
    """A row of the table of rivals: a hypothesis, what it leaves of the judged runs, how likely.

    `kind` is nothing, parameters, effect or law; `name` that of the effect or of the law's place,
    `places` where it acts. `gap` is over all signals in floors, `by_signal` that of each.
    """

    kind: str
    name: str
    words: str
    places: list[str]
    gap: float
    by_signal: dict[str, float]
    probability: float


class RivalScore(msgspec.Struct, frozen=True, kw_only=True):
    """What the probability of a rival is made of, so that constants are fitted without a replay.

    `scores` are those of `rivals/score.py`, one for each judged run, `log_prior` that of where its
    parameters are, `gap` what it leaves of the judged runs in floors.
    """

    kind: str
    name: str
    places: list[str]
    gap: float
    scores: list[float]
    log_prior: float


class Cause(msgspec.Struct, frozen=True, kw_only=True):
    """One thing that the simulator lacks, with the rivals that it was told from.

    `kind` is effect or law, `name` that of the effect (empty for a law), `place` where it acts, in
    `words`. `probability` is that of the place. `names` are effects of the library with their
    probabilities if it is one of them, `outside` the probability that it is none. `credible_names`
    and `credible_places` are the fewest that together hold the level of the constants. `terms`
    are a law's, `values` an effect's. `gap` is what the judged runs are left with by all causes up
    to this one.
    """

    kind: str
    name: str
    place: str
    side: str
    words: str
    probability: float
    names: dict[str, float]
    outside: float
    credible_names: list[str]
    credible_places: list[str]
    places: dict[str, float]
    values: list[EffectValue]
    terms: list[LawTerm]
    largest: float
    unit: str
    gap: float
    rivals: list[RivalGap]

    @property
    def title(self) -> str:
        """The cause in words: the effect with its values, or the law's place."""
        if self.kind == "effect":
            values = ", ".join(v.text for v in self.values)
            return f"{self.name} ({values})"
        return f"a law at the {self.words}"

    @property
    def read(self) -> list[LawTerm]:
        """The terms that say something: a constant only where there is no other.

        Beside others it depends on where the middle of their states lies.
        """
        return self.terms[:-1] if len(self.terms) > 1 else self.terms


class ParameterMoved(msgspec.Struct, frozen=True, kw_only=True):
    """A parameter of the model: as configured, in the final model, and its standard deviation."""

    name: str
    unit: str
    before: float
    after: float
    sd: float
    at_bound: bool


class SignalGap(msgspec.Struct, frozen=True, kw_only=True):
    """One signal's RMS of measured − predicted on the runs judged, in its unit.

    `raw`: the simulator as configured; `parameters`: with other values of the parameters;
    `causes`: with the first cause, the first two, and so on. `floor` is its noise.
    """

    signal: str
    unit: str
    floor: float
    raw: float
    parameters: float
    causes: list[float]

    @property
    def final(self) -> float:
        """With everything that is told."""
        return self.causes[-1] if self.causes else self.parameters


class RunGap(msgspec.Struct, frozen=True, kw_only=True):
    """One judged run's gap over all signals, in floors, as in `SignalGap`."""

    run: str
    raw: float
    parameters: float
    final: float


class Repeated(msgspec.Struct, frozen=True, kw_only=True):
    """What runs say that repeat the inputs of known-good ones: pairs in words, and their answer."""

    lines: list[str]
    repeats: int
    outcome: str = ""
    headline: str = ""


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """The answer to one question: *differs* (no good runs), *changed* (since the good runs) or
    *check-up* (the same inputs).

    `causes` are in the order in which they entered; `rivals` is the table of the last step, in
    which nothing more was likeliest (or nothing at all), `first_step` all rivals of the first one.
    `models` are model files as text: with
    other parameters, then with each cause (empty for a plant that writes none). `whole` is over all
    signals, in floors. `unseen` says of each effect which strength these runs would not have shown.
    """

    question: str
    outcome: str
    headline: str
    causes: list[Cause] = []
    rivals: list[RivalGap] = []
    first_step: list[RivalScore] = []
    parameters: list[ParameterMoved] = []
    budget: list[SignalGap] = []
    whole: SignalGap | None = None
    by_run: list[RunGap] = []
    judged_on: str = ""
    unseen: list[str] = []
    notes: list[str] = []
    findings: list[Finding] = []
    runs: list[RunRecord] = []
    repeated: Repeated | None = None
    models: list[str] = []
    plant: str = ""
    plant_version: str = ""
    smad_version: str = ""
    seconds: float = 0.0

    def to_json(self) -> bytes:
        """The verdict as indented JSON."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1)

    @classmethod
    def from_json(cls, data: bytes) -> Verdict:
        """Read what `to_json` wrote. Raises msgspec.DecodeError."""
        return msgspec.json.decode(data, type=cls)

    def write_model(self, path: Path, first: int | None = None) -> None:
        """Write the model file: with the first causes, or all.

        Raises PlantMismatch where the verdict has no model, or not as many causes.
        """
        if not self.models:
            raise PlantMismatch(
                "this verdict has no model to write",
                value=f"{self.outcome}, plant {self.plant}",
                action="correct what it refuses, or ask a plant that writes model files",
            )
        most = len(self.models) - 1
        if first is not None and not 0 <= first <= most:
            raise PlantMismatch(
                "the verdict has fewer causes",
                value=first,
                limit=f"0 (parameters alone) to {most}",
                action="give a number of causes that it lists",
            )
        path.write_text(self.models[most if first is None else first], "utf-8")


def headline_of(
    question: str, outcome: str, causes: Sequence[Cause], whole: SignalGap | None
) -> str:
    """The verdict in one line."""
    before, after = ("", "") if whole is None else (f"{whole.parameters:.1f}", f"{whole.final:.1f}")
    if outcome == QUIET:
        return {
            DIFFERS: "nothing is missing: the simulator is as good as the readings",
            CHANGED: "nothing is new beyond what good runs differ in",
            CHECK_UP: "no change beyond the repeat floor",
        }[question]
    if outcome == PARAMETERS:
        raw = "" if whole is None else f": {whole.raw:.1f} → {before} floors"
        verb = "changed: " if question != DIFFERS else ""
        return f"{verb}other values of the parameters explain it{raw}"
    if outcome == UNEXPLAINED:
        verb = "changed" if question != DIFFERS else "something is missing"
        return f"{verb}, and no rival brings the judged runs nearer: {before} floors are left"
    first = causes[0]
    missing = f"the {first.words} {'has changed' if question != DIFFERS else 'lacks something'}"
    what = first.title if first.kind == "effect" else "no effect of the library fits"
    beside = f", and {len(causes) - 1} more" if len(causes) > 1 else ""
    return f"{missing}: {what}{beside}; {before} → {after} floors"
