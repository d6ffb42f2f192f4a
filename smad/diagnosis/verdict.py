"""The verdict of a diagnosis as records that are written to JSON as they are.

Reports, commands and files state nothing of a diagnosis that is not a field of `Verdict`.
"""

from __future__ import annotations

import contextlib
import json
import tomllib
from collections.abc import Sequence
from pathlib import Path

import msgspec

from smad.diagnosis.constants import shipped
from smad.diagnosis.errors import GapError, PlantMismatch
from smad.diagnosis.runs import GapRun
from smad.files import read_whole
from smad.units import in_words, with_sd, with_unit

QUIET, PARAMETERS, CAUSES, UNEXPLAINED, REFUSED = OUTCOMES = (
    "quiet", "parameters", "causes", "unexplained", "refused",
)  # fmt: skip
"""Nothing above the floor; other values of the parameters explain the gap; causes are reported;
something is missing that no rival explains; no verdict."""
DIFFERS, CHANGED, CHECK_UP = "differs", "changed", "check-up"
COLUMN_DOUBTED = "column doubted"
"""Kind of the finding that a column looks misread."""
MEASURED, PAIRED = "measured − predicted", "whitened now − then"
"""What gaps are measured on: single runs, or pairs with a good run."""

AT_FLOOR = 1.3
"""Floors are known to a third: a channel that leaves at most so many floors shows nothing."""
_NAMED = 2
"""Names beside the first one that a heading lists."""
_UNEXPLAINED_FLOORS = 1.5
"""A gap above it is more than noise: floors are known to a third, and runs differ."""


class Finding(msgspec.Struct, frozen=True):
    """A fact or a doubt about a run, of a `kind`; `refuses`: the run is not used because of it."""

    run: str
    kind: str
    text: str
    refuses: bool


class RunRecord(msgspec.Struct, frozen=True):
    """A run that was given. `role` is fit, hold-out, good or refused; `repeats` is the name of the
    good run with the same inputs, in a check-up."""

    name: str
    role: str
    duration_s: float
    sha256: str
    repeats: str = ""

    @classmethod
    def of(cls, run: GapRun, role: str, repeats: str = "") -> RunRecord:
        return cls(run.name, role, round(run.duration_s, 3), run.digest, repeats)


class LawTerm(msgspec.Struct, frozen=True, kw_only=True):
    """A term of a law: the `state` that it depends on, in `words`, and its `slopes` by spring with
    their standard deviations `sd`, in `unit`. `alike` names states that these runs do not
    distinguish from this one."""

    name: str
    state: str
    words: str
    slopes: dict[str, float]
    sd: dict[str, float]
    unit: str
    alike: str = ""

    @property
    def text(self) -> str:
        """What it goes with and how, as users read it."""
        slopes = ", ".join(
            f"{'' if side == 'both' else side.upper() + ' '}{with_sd(v, self.sd[side], '+')}"
            for side, v in self.slopes.items()
        )
        return f"{self.words}: {slopes} {in_words(self.unit)}".rstrip()


class EffectValue(msgspec.Struct, frozen=True, kw_only=True):
    """A parameter of an effect, in `unit`, with its standard deviation if it was computed.

    `at_bound`: a strength that a wider range might let grow, for which the deviation says nothing.
    """

    name: str
    value: float
    sd: float | None
    unit: str
    at_bound: bool = False

    @property
    def text(self) -> str:
        """As users read it: tau_s = 0.600 ± 0.002 s, or 0.6 s."""
        if self.sd is None:
            text = f"{self.name} = {self.value:.3g} {in_words(self.unit)}".rstrip()
        else:
            text = f"{self.name} = {with_unit(self.value, self.sd, self.unit)}"
        return text + " (at the end of its range)" * self.at_bound


class RivalGap(msgspec.Struct, frozen=True, kw_only=True):
    """A row of the table of rivals: a hypothesis, its gap on the judged runs, its probability.

    `kind` is nothing, parameters, effect or law; `name` that of the effect or of the law's place,
    `places` where it acts. `title` says what an effect is, `values` are those that fit it best.
    `gap` is over all signals in floors, `by_signal` that of each.
    """

    kind: str
    name: str
    words: str
    title: str = ""
    values: list[EffectValue] = []
    places: list[str]
    gap: float
    by_signal: dict[str, float]
    probability: float


class Cause(msgspec.Struct, frozen=True, kw_only=True):
    """One thing that the simulator lacks, with the rivals that it was compared with.

    `kind` is effect or law, `name` that of the effect (empty for a law), `place` where it acts, in
    `words`. `probability` is that of the place. `names` are effects of the library with their
    probabilities if it is one of them, `outside` the probability that it is none. `credible_names`
    and `credible_places` are the fewest that together hold the level of the constants; `places` has
    the probabilities of all, `place_words` what they are. `terms` are a law's, `values` an
    effect's. `gap` is what all causes up to this one leave of the judged runs, in floors. `beside`
    are the parts, in words, that every rival of the table has.
    """

    kind: str
    name: str
    place: str
    words: str
    probability: float
    names: dict[str, float]
    outside: float
    credible_names: list[str]
    credible_places: list[str]
    places: dict[str, float]
    place_words: dict[str, str]
    values: list[EffectValue]
    terms: list[LawTerm]
    unit: str
    gap: float
    rivals: list[RivalGap]
    beside: list[str] = []

    @property
    def title(self) -> str:
        """The cause in words, for a heading: the effect with its first value, or a law."""
        others = self.other_names
        if self.kind != "effect":
            if not others:
                return "a law, no effect of the library fits"
            few = " or ".join(others) if len(others) <= _NAMED else f"one of {len(others)} effects"
            return f"a law or {few}"
        if len(self.named) <= len(others):
            return f"{self.name} or one of {len(others)} others"
        value = "" if others or not self.values else f", {self.values[0].text}"
        return " or ".join(self.named) + value

    @property
    def named(self) -> list[str]:
        """The effects that a headline names: the one that was found, and others if they are few."""
        others = self.other_names
        return [self.name, *(others if len(others) <= _NAMED else ())] if self.name else []

    @property
    def other_names(self) -> list[str]:
        """The effects that are as credible as what was found; none where a law alone is."""
        if self.kind != "effect" and self.outside >= shipped().credible_level:
            return []
        return [n for n in self.credible_names if n != self.name]

    @property
    def short(self) -> str:
        """The effect by its name, a law by its place."""
        return self.name or f"a law at the {self.words}"

    @property
    def rival(self) -> RivalGap | None:
        """Its row in the table of rivals; None where the table lacks it."""
        name = self.name or self.place
        return next((r for r in self.rivals if r.kind == self.kind and r.name == name), None)

    @property
    def read(self) -> list[LawTerm]:
        """The terms without the constant beside them, whose value depends on where the middle of
        their states lies."""
        return self.terms[:-1] if len(self.terms) > 1 else self.terms

    @property
    def law_lines(self) -> list[str]:
        """A law as users read it: its terms, the constant beside others without a value."""
        constant = ["and a constant"] if len(self.terms) > len(self.read) else []
        return [term.text for term in self.read] + constant

    @property
    def refitted(self) -> bool:
        """Whether its values differ from those in the table of rivals, by later fits."""
        row = self.rival
        return row is None or [v.text for v in row.values] != [v.text for v in self.values]


class ParameterMoved(msgspec.Struct, frozen=True, kw_only=True):
    """A parameter: where the question starts (as configured, or fitted to the good runs), in the
    final model, and its standard deviation."""

    name: str
    unit: str
    before: float
    after: float
    sd: float
    at_bound: bool
    words: str = ""


class SignalGap(msgspec.Struct, frozen=True, kw_only=True):
    """One signal's RMS on the judged runs, in its unit, of the quantity in the verdict's `gaps_of`.

    `raw`: the simulator as configured, or that of the good runs; `parameters`: with other values;
    `causes`: with the first cause, the first two, and so on. `floor` is its noise.
    """

    signal: str
    unit: str
    floor: float
    raw: float
    parameters: float
    causes: list[float]
    words: str = ""

    @property
    def label(self) -> str:
        """What it is, in words where there are any."""
        return self.words or self.signal

    @property
    def final(self) -> float:
        """With all causes."""
        return self.causes[-1] if self.causes else self.parameters


class RunGap(msgspec.Struct, frozen=True, kw_only=True):
    """One judged run's gap over all signals, in floors, as in `SignalGap`."""

    run: str
    raw: float
    parameters: float
    final: float


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """The answer to one question: *differs* (no good runs), *changed* (since the good runs) or
    *check-up* (the same inputs).

    `causes` are in the order in which they entered; `rivals` is the table of the last step, that of
    the last cause where the search ended with it. `models` are model files as text: with other
    parameters, then with each cause; of a bench that is as it was, that of its good runs (none for
    a plant that writes none). `budget` has the gap of each signal, of what `gaps_of` says, and
    `whole` that over all signals, in floors. `unseen` says of each effect which strength these runs
    would not have shown.
    """

    question: str
    outcome: str
    headline: str
    causes: list[Cause] = []
    rivals: list[RivalGap] = []
    parameters: list[ParameterMoved] = []
    gaps_of: str = MEASURED
    budget: list[SignalGap] = []
    whole: SignalGap | None = None
    by_run: list[RunGap] = []
    judged_on: str = ""
    unseen: list[str] = []
    notes: list[str] = []
    findings: list[Finding] = []
    runs: list[RunRecord] = []
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

    def write_model(self, path: Path | str, first: int | None = None) -> None:
        """Write the model file as `model_text` has it; a name `.json` makes it JSON."""
        Path(path).write_text(self.model_text(first, as_json=Path(path).suffix == ".json"), "utf-8")

    def model_text(self, first: int | None = None, *, as_json: bool = False) -> str:
        """The model file with the first causes, or all.

        Raises PlantMismatch where the verdict has no model, or not as many causes.
        """
        if not self.models:
            in_python = (
                "only a plant class with save_model writes one (SavesModel in "
                "smad.diagnosis.plant); or read answer.model, verdict.parameters and the values of "
                "verdict.causes in Python"
            )
            raise PlantMismatch(
                "this verdict has no model to write",
                value=f"{self.outcome}, plant {self.plant}",
                action="correct what it refuses, and ask again"
                if self.outcome == REFUSED
                else in_python,
            )
        most = len(self.models) - 1
        if first is not None and not 0 <= first <= most:
            raise PlantMismatch(
                "the verdict has fewer causes",
                value=first,
                limit=f"0 (parameters alone) to {most}",
                action="give a number of causes that it lists",
            )
        text = self.models[most if first is None else first]
        if as_json:
            # A plant of somebody else may write another format than TOML.
            with contextlib.suppress(tomllib.TOMLDecodeError):
                return json.dumps(tomllib.loads(text), indent=2) + "\n"
        return text


def headline_of(
    question: str, outcome: str, causes: Sequence[Cause], whole: SignalGap | None
) -> str:
    """The verdict in one line."""
    if outcome == QUIET:
        return {
            DIFFERS: "nothing is missing beyond the floor of the readings",
            CHANGED: "nothing is new beyond the difference between good runs",
            CHECK_UP: "no change beyond the repeat floor",
        }[question]
    changed = question != DIFFERS
    raw, before, after = (0.0,) * 3 if whole is None else (whole.raw, whole.parameters, whole.final)
    if outcome == PARAMETERS:
        goes = _goes(raw, before)
        return f"{'changed: ' * changed}other values of the parameters explain it; {goes}"
    if outcome == UNEXPLAINED:
        verb = "something has changed" if changed else "something is missing"
        moved = f", {before:.1f} with other values of the parameters" if before < raw else ""
        return f"{verb} that no rival explains: {raw:.1f} floors are left{moved}"
    first = causes[0]
    verb = "something has changed at" if changed else "the simulator lacks something at"
    likely = f", probability {first.rival.probability:.2f}" if first.rival else ""
    if likely and first.other_names:
        likely += " for the first"
    beside = "".join(f", and {cause.short}" for cause in causes[1:])
    goes = _goes(before, after)
    if round(before, 2) <= round(after, 2):
        # Near the floor parameters may imitate a cause, by values far from the prior.
        goes = f"{_goes(raw, after)}; unlikely values of the parameters leave {before:.1f}"
    return f"{verb} the {first.words}: {first.title}{likely}{beside}; {goes}"


def _goes(before: float, after: float) -> str:
    """How a gap shrinks, in words, with the digits that show it, and what remains above noise."""
    digits = 1 if f"{before:.1f}" != f"{after:.1f}" else 2
    rest = f", {after:.{digits}f} floors stay unexplained" if after > _UNEXPLAINED_FLOORS else ""
    return f"the gap goes from {before:.{digits}f} to {after:.{digits}f} floors{rest}"


def read_verdict(path: Path) -> Verdict:
    """The verdict in a file that `smad gap diagnose` wrote. Raises GapError for another file."""
    try:
        return Verdict.from_json(read_whole(path))
    except msgspec.DecodeError as error:
        raise GapError(
            f"{path} is not a verdict: {error}",
            action="give a file that --json of smad gap diagnose or smad gap checkup wrote",
        ) from error
