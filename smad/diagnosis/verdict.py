"""What a diagnosis says, as records that go to JSON as they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from smad.diagnosis.errors import PlantMismatch

QUIET, PARAMETERS, PLACES = "quiet", "parameters", "places"
UNPLACED, REFUSED, CONTRADICTING = "unplaced", "refused", "contradicting"
OUTCOMES = (QUIET, PARAMETERS, PLACES, UNPLACED, CONTRADICTING, REFUSED)
"""Nothing beyond the floor; other values of parameters explain it; places with laws; changed, and
no place takes enough; no verdict."""
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


class TermTold(msgspec.Struct, frozen=True, kw_only=True):
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


class PlaceTold(msgspec.Struct, frozen=True, kw_only=True):
    """One answer: where, which law, what name.

    `share` is what the place adds on runs left out; `near` are the other places that may be it, in
    words, `near_places` their names with the first's own, `probabilities` theirs. `largest` is the
    law's largest value in the runs, in `unit`. `in_simulator` says whether the law brought the
    simulator nearer to the bench. `name` is an effect of the library that acts there, empty for
    none, and `values` its values; `names` are effects with their probabilities, `nearest` the best
    of those that act there, `takes` what it takes of what the law takes.
    """

    place: str
    side: str
    words: str
    share: float
    near: list[str]
    near_places: list[str]
    probabilities: list[float]
    terms: list[TermTold]
    largest: float
    unit: str
    in_simulator: bool
    name: str = ""
    values: dict[str, dict[str, float]] = {}
    nearest: str = ""
    names: dict[str, float] = {}
    takes: float = 0.0

    @property
    def probability(self) -> float:
        """That of the first place, of all that may be what is missing."""
        return self.probabilities[0]

    @property
    def read(self) -> list[TermTold]:
        """The terms that say something: a constant only where there is no other.

        Beside others it depends on where the middle of their states lies.
        """
        return self.terms[:-1] if len(self.terms) > 1 else self.terms


def change_headline(outcome: str, places: Sequence[PlaceTold], quiet: str) -> str:
    """A change in one line: its first place with the size of the law there, and how many more.

    `quiet` is what is said of none.
    """
    if outcome == QUIET:
        return quiet
    if outcome == PARAMETERS:
        return "changed: other values of the parameters explain it"
    if not places:
        return "changed, and no place takes enough of it"
    first, *further = places
    size = (
        f", by up to {first.largest:.2g} {first.unit}"
        if first.unit != "1"
        else f", by up to {100 * first.largest:.2g} %"
    )
    beside = f", and {len(further)} more" if further else ""
    return f"changed: {first.words}{size}{beside}"


class ParameterTold(msgspec.Struct, frozen=True, kw_only=True):
    """A parameter of the model: as configured, in the model that is told, and its deviation."""

    name: str
    unit: str
    before: float
    after: float
    sd: float
    at_bound: bool


class SignalGap(msgspec.Struct, frozen=True, kw_only=True):
    """One signal's RMS of measured − predicted on the runs judged, in its unit.

    `raw`: the model before; `parameters`: with other values of the parameters; `places`: with the
    laws of the first place, the first two, and so on. Each run is judged by a model that had no
    part of it. `floor` is its noise.
    """

    signal: str
    unit: str
    floor: float
    raw: float
    parameters: float
    places: list[float]

    @property
    def final(self) -> float:
        """With all that is told."""
        return self.places[-1] if self.places else self.parameters


class RunGap(msgspec.Struct, frozen=True, kw_only=True):
    """One run's gap over all signals, in floors, as in `SignalGap`.

    `apart` is the share that a law of its own would add for this run alone; where the run is not of
    one state with the others, `contradicts` is set.
    """

    run: str
    raw: float
    parameters: float
    final: float
    apart: float = 0.0
    contradicts: bool = False


class PlaceShare(msgspec.Struct, frozen=True, kw_only=True):
    """What the best law of a place alone takes, beside nothing else; for the map of places."""

    place: str
    side: str
    words: str
    share: float


class Repeated(msgspec.Struct, frozen=True, kw_only=True):
    """What runs say that repeat the inputs of known-good ones: pairs in words, and their answer."""

    lines: list[str]
    repeats: int
    outcome: str = ""
    headline: str = ""


class Verdict(msgspec.Struct, frozen=True, kw_only=True):
    """The answer to one question: *differs* (no good runs), *changed* (since the good runs) or
    *check-up* (the same inputs).

    `places` are in the order in which they take most; `models` are model files as text: after the
    parameters, then after each place (empty for a plant that writes none). `parameters_take` is the
    share of the gap that other values of the parameters take, `unseen` what these runs could not
    have shown. `whole` is over all signals, in floors.
    """

    question: str
    outcome: str
    headline: str
    parameters_take: float = 0.0
    places: list[PlaceTold] = []
    parameters: list[ParameterTold] = []
    budget: list[SignalGap] = []
    whole: SignalGap | None = None
    by_run: list[RunGap] = []
    ranked: list[PlaceShare] = []
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
        """Write the model file: with the first places, or all.

        Raises PlantMismatch where the verdict has no model, or not as many places.
        """
        if not self.models:
            raise PlantMismatch(
                "this verdict has no model to write",
                value=f"{self.outcome}, plant {self.plant}",
                action="mend what it refuses, or ask a plant that writes model files",
            )
        most = len(self.models) - 1
        if first is not None and not 0 <= first <= most:
            raise PlantMismatch(
                "the verdict has fewer places",
                value=first,
                limit=f"0 (parameters alone) to {most}",
                action="give a number of places that it lists",
            )
        path.write_text(self.models[most if first is None else first], "utf-8")
