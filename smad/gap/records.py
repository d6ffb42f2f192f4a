"""The result of a diagnosis, as typed records that go to JSON as they are."""

from __future__ import annotations

from enum import StrEnum
from typing import Any

import msgspec
from msgspec import inspect

from smad import notebook


class Outcome(StrEnum):
    """The seven verdicts, and the cases in which the runs support none."""

    NO_GAP = "no gap"
    PARAMETERS = "parameters only"
    EFFECT = "effect"
    AMBIGUOUS = "not separable"
    PLUS_REST = "effect plus rest"
    UNKNOWN = "unknown"
    NO_EXCITATION = "not enough excitation"
    REFUSED = "runs refused"
    CONTRADICTING = "runs contradict each other"


HALF_CHI2_95 = 1.92
"""Rise of a profile's negative log-likelihood at the ends of its 95 % interval."""

NAMED = frozenset((Outcome.EFFECT, Outcome.AMBIGUOUS, Outcome.PLUS_REST))
"""Outcomes that name a cause."""


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


class FloorRecord(msgspec.Struct, frozen=True):
    channel: str
    unit: str
    sigma: float
    rho: float
    source: str


class ValueRecord(msgspec.Struct, frozen=True):
    """A fitted parameter of an effect, with its fit interval; `before` in known-good runs.

    `low` to `high` is what the scatter of these runs alone leaves open at the 95 % level. What the
    model leaves out (its form, steps, sensors) is not in it, so it holds the truth less often.
    """

    effect: str
    name: str
    unit: str
    value: float
    before: float
    low: float
    high: float
    at_bound: bool
    identifiable: bool
    profile: list[tuple[float, float]]


class ParameterRecord(msgspec.Struct, frozen=True):
    """A parameter of the model: its value before, after the refit, and with the effects."""

    name: str
    unit: str
    before: float
    refit: float
    final: float
    low: float
    high: float
    at_bound: bool


class LawRecord(msgspec.Struct, frozen=True):
    """A value of a law that the model holds: in known-good runs, and after the refit."""

    law: str
    name: str
    unit: str
    before: float
    after: float


class WaterfallRow(msgspec.Struct, frozen=True):
    """Excess gap over the floor on held-out runs; `output` "" is all together."""

    view: str
    output: str
    channel: str
    unit: str
    floor: float
    raw: float
    refit: float
    effects: list[float]


class CellRecord(msgspec.Struct, frozen=True):
    sub_model: str
    side: str
    regime: str
    raw: float
    refit: float
    final: float


class WindowRecord(msgspec.Struct, frozen=True):
    run: str
    output: str
    channel: str
    start_s: float
    stop_s: float
    share: float


class CandidateRecord(msgspec.Struct, frozen=True):
    """How one candidate fared. Fields beyond the screening are None where it was not fitted."""

    name: str
    title: str
    sub_model: str
    screen_gain: float
    masked: float
    visible: float
    gain: float | None = None
    gain_se: float | None = None
    regime_gain: float | None = None
    shrink: float | None = None
    probability: float | None = None


class FittedRecord(msgspec.Struct, frozen=True):
    """One model that was fitted jointly: the effects in it (none: the refit alone).

    `parameters` and `rows` count what was fitted, and to how much. `objective` is minus the
    logarithm of the posterior on the fit runs, `chi2` the sum of their squared white residuals.
    `held_out` is the RMS over the held-out rows, each in floors, `gap` their excess G over the
    floor, and `score` their log-likelihood.
    """

    names: list[str]
    parameters: int
    rows: int
    objective: float
    chi2: float
    held_out: float
    gap: float
    score: float


class LeftOutRecord(msgspec.Struct, frozen=True):
    """The verdict when `effect` is taken out of the library: it ought to become unknown."""

    effect: str
    outcome: Outcome
    names: list[str]
    probability: float


class ResidualTest(msgspec.Struct, frozen=True):
    """A diagnostic of the residual that is left; not part of the verdict."""

    output: str
    test: str
    statistic: float
    p_value: float


class ExperimentRecord(msgspec.Struct, frozen=True):
    """A proposed experiment.

    `separation` is the d² between the hypotheses that the models predict of one run, `counted` the
    part of it that can be counted on, `together` that of this experiment and those before it. The
    last two are None in older files.
    """

    name: str
    title: str
    duration_s: float
    separation: float
    command: str
    counted: float | None = None
    together: float | None = None


class Trace(msgspec.Struct, frozen=True):
    """One held-out output, for the overlay: time and values in channel units."""

    run: str
    view: str
    output: str
    channel: str
    unit: str
    t_s: list[float]
    measured: list[float]
    refit: list[float]
    final: list[float]


class BudgetRow(msgspec.Struct, frozen=True):
    """Where the gap of one signal goes; `signal` "" is all of them together.

    `raw` and `left` are gaps in floors, the others shares of the raw gap: what other values of the
    `parameters` take, each of the `causes` in turn, and the `rest`. They add up to 1.
    """

    signal: str
    floor: float
    unit: str
    raw: float
    parameters: float
    causes: list[float]
    rest: float
    left: float


class RunGap(msgspec.Struct, frozen=True):
    """The gap of one run in floors: as configured, after the parameters, with the causes."""

    run: str
    raw: float
    refit: float
    final: float


class RunAgreement(msgspec.Struct, frozen=True, kw_only=True):
    """One run to fit, before it is pooled with the others.

    `gap` is that of the model as it was, in floors. `own_gain` says by how many nats a cell the
    run's own halves predict each other better than the answer for all runs describes it, under the
    cause by which runs predict themselves best; above a few the runs are not of one state.
    `contradicts`: without this run, and the others so marked, one set of values serves the rest.
    Where all runs are marked, none agrees with another.
    """

    run: str
    gap: float
    own_gain: float
    contradicts: bool


class Budget(msgspec.Struct, frozen=True):
    """Where the gap goes on the runs judged: raw, parameters, each cause in turn, rest, noise.

    The noise is 1 floor in every signal, by which all gaps are told. `causes` are those of the
    answer, or, where none is `named`, the best that the library has. `parameters` says whether
    other values of the parameters are needed at all beside the causes: where the model with the
    causes alone predicts as well, they take nothing, and `alone` is what they would take without.
    `dominated_by` is the run that carries `dominating` of the excess power after the parameters,
    "" where none carries most of it.
    """

    causes: list[str]
    named: bool
    parameters: bool
    alone: float
    rows: list[BudgetRow]
    runs: list[RunGap]
    median: RunGap | None
    dominated_by: str
    dominating: float


class Verdict(msgspec.Struct, frozen=True):
    """What the diagnosis says.

    `effects` in order of importance; `group` the effects that cannot be told from the first;
    `probability` that of the outcome's named cause (the group's together). Gaps are G over the
    floor, on held-out runs, of the local views; `open_loop` the same for the whole simulator.
    `imitated`: other values of the parameters predict as well as `effects`. `instead` are effects
    that the parameters of the known-good runs ask for, whose place other values of the parameters
    have taken; they would have left `gap_instead`.
    `plain` is the answer in a sentence or two, `text` the numbers behind it, a line each. `bounded`
    are effects that are not named because their strength ran into the bound of its range.
    """

    outcome: Outcome
    text: str
    plain: str = ""
    probability: float = 1.0
    effects: list[str] = []
    group: list[str] = []
    sub_model: str = ""
    regimes: list[str] = []
    probabilities: dict[str, float] = {}
    gap_raw: float = 0.0
    gap_refit: float = 0.0
    gap_final: float = 0.0
    shrink: float = 0.0
    shrink_low: float = 0.0
    shrink_high: float = 0.0
    ceiling: float = 0.0
    open_loop: list[float] = []
    imitated: bool = False
    instead: list[str] = []
    gap_instead: float | None = None
    bounded: list[str] = []


class RepeatedRecord(msgspec.Struct, frozen=True):
    """What runs say that repeat the inputs of known-good ones, compared without the model's form.

    `pairs` say in words which run repeats which, `repeats` how often each was recorded good. With
    less than two there is no answer: `outcome` and `headline` are those of a check-up, and
    `probabilities` go by names joined with " + ".
    """

    pairs: list[str]
    repeats: int
    outcome: str = ""
    headline: str = ""
    probabilities: dict[str, float] = {}


class Diagnosis(msgspec.Struct, frozen=True):
    """Everything a diagnosis found.

    `fitted` are all models that were fitted jointly, the refit first. `places` holds for each
    effect of the best model the probability of every effect in its place, "" being none; with no
    effect in the best model it has one place "", and none at all where nothing was tried or the
    free refit answers. `left_out` is filled when it was asked for, `repeated` where runs repeat
    known-good ones.
    """

    plant: str
    plant_version: str
    versions: dict[str, str]
    settings: dict[str, Any]
    question: str
    judged_on: str
    verdict: Verdict
    runs: list[RunRecord]
    findings: list[Finding]
    limits: list[str]
    seconds: float
    missing: list[str] = []
    floors: list[FloorRecord] = []
    steps: list[list[str]] = []
    waterfall: list[WaterfallRow] = []
    heat: list[CellRecord] = []
    windows: list[WindowRecord] = []
    candidates: list[CandidateRecord] = []
    values: list[ValueRecord] = []
    parameters: list[ParameterRecord] = []
    residual_tests: list[ResidualTest] = []
    experiments: list[ExperimentRecord] = []
    traces: list[Trace] = []
    model: dict[str, Any] = {}
    fitted: list[FittedRecord] = []
    places: dict[str, dict[str, float]] = {}
    left_out: list[LeftOutRecord] = []
    laws: list[LawRecord] = []
    budget: Budget | None = None
    agreement: list[RunAgreement] = []
    repeated: RepeatedRecord | None = None

    def _repr_html_(self) -> str:
        values = [
            (v.effect, v.name, f"{v.value:.4g} {v.unit}", f"{v.low:.4g} … {v.high:.4g}")
            for v in self.values
        ]
        header = ("effect", "parameter", "value", "fit interval") if values else ()
        title = f"Gap diagnosis of {self.plant}: {self.verdict.outcome}"
        return notebook.table(title, header, values, self.verdict.plain)

    def to_json(self) -> bytes:
        """JSON with the same content; NaN and infinities become null."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1)

    @classmethod
    def from_json(cls, data: bytes) -> Diagnosis:
        """The record that `to_json` wrote; what was NaN or infinite is NaN."""
        known = _with_nan(msgspec.json.decode(data), inspect.type_info(cls))
        return msgspec.convert(known, type=cls)


def _with_nan(value: Any, wanted: inspect.Type) -> Any:
    """A decoded value, NaN for null wherever nothing but a number is wanted."""
    match wanted, value:
        case inspect.FloatType(), None:
            return float("nan")
        case inspect.StructType(), dict():
            kinds = {f.encode_name: f.type for f in wanted.fields}
            return {k: _with_nan(v, kinds[k]) if k in kinds else v for k, v in value.items()}
        case inspect.DictType(), dict():
            return {k: _with_nan(v, wanted.value_type) for k, v in value.items()}
        case inspect.ListType(), list():
            return [_with_nan(v, wanted.item_type) for v in value]
        case inspect.TupleType(), list():
            kinds_of_items = (*wanted.item_types, *[inspect.AnyType()] * len(value))
            return [_with_nan(v, k) for v, k in zip(value, kinds_of_items, strict=False)]
    return value
