"""The interface of a plant: signals, parameters, effects, and how to simulate it.

Anything that satisfies `PlantModel` can be diagnosed. No module of the engine knows the name of a
channel, a parameter or an effect.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from smad import arrays
from smad.diagnosis.errors import GapError
from smad.diagnosis.runs import GapRun

Array = arrays.Array
Singles = arrays.Singles
Index = arrays.Index
Mask = arrays.Mask
EffectValues = Mapping[str, Mapping[str, float]]
"""Values of the parameters of each effect that is switched on, by effect and parameter name."""


@dataclass(frozen=True, slots=True)
class Signal:
    """An input that was applied, as recorded. Its `power` acts: 2 for a current that heats."""

    name: str
    unit: str
    low: float
    high: float
    power: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A measured channel: quantum and range in its unit.

    `twin` names the channel of the same kind on the other side, if there is one; swapped cables are
    looked for between twins. `noise` is a typical standard deviation of one sample, used only when
    no run allows an estimate. `words` say what it measures.
    """

    name: str
    unit: str
    quantum: float
    low: float
    high: float
    noise: float
    side: str = ""
    twin: str = ""
    words: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """A parameter that the refit may move, in its unit, with hard bounds and a prior.

    `words` say what it is.
    """

    name: str
    unit: str
    nominal: float
    low: float
    high: float
    prior_sd: float
    words: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EffectParameter:
    """One parameter of an effect.

    A *strength* switches the effect: at 0 it is absent. A *shape* says how the effect acts and
    means nothing while every strength is 0. `low < 0` makes a strength two-sided. `meaning` is what
    it is in the effect's equation.

    Raises GapError for a range without width, and for a strength that is typically absent.
    """

    name: str
    unit: str
    typical: float
    low: float
    high: float
    strength: bool = True
    meaning: str = ""

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise GapError(
                f"the effect parameter {self.name} has no range",
                value=f"{self.low:g} to {self.high:g} {self.unit}",
                limit="low < high",
                action="correct it in the plant's library",
            )
        if self.strength and self.typical == 0.0:
            raise GapError(
                f"the strength {self.name} is typically 0, which is not an effect at all",
                value=self.typical,
                limit="not 0",
                action="give the value that a bench may well show",
            )

    @property
    def scale(self) -> float:
        """The unit of its coordinate in a fit: |typical|, or half the range where that is 0."""
        return abs(self.typical) or (self.high - self.low) / 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """A candidate cause: an entry of the plant's library. `places`: where it acts, by name."""

    name: str
    title: str
    parameters: tuple[EffectParameter, ...]
    signals: tuple[str, ...]
    sub_model: str = ""
    equation: str = ""
    confused_with: tuple[str, ...] = ()
    separates: str = ""
    reference: str = ""
    places: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Experiment:
    """An entry of the plant's catalogue of safe experiments, in the order it would be offered."""

    name: str
    title: str
    duration_s: float
    command: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class ModelPoint:
    """A point of the model space: parameters by name, effects that are on with their values.

    laws: what is missing at places, as the plant itself writes it. Plants may keep what they made
    of a point, by its identity.
    """

    theta: Mapping[str, float]
    effects: EffectValues = field(default_factory=dict)
    laws: tuple[Any, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Covariance (k, k) of the values of a fitted model, in the plant's own units.

    A name is that of a parameter, or EFFECT.PARAMETER.
    """

    names: tuple[str, ...]
    covariance: Array


class PlantModel(Protocol):
    """The interface of a plant. Arrays are one value a sample of the run, in channel units."""

    @property
    def name(self) -> str: ...
    @property
    def version(self) -> str: ...
    @property
    def inputs(self) -> Sequence[Signal]: ...
    @property
    def channels(self) -> Sequence[Channel]: ...
    @property
    def parameters(self) -> Sequence[Parameter]: ...
    @property
    def effects(self) -> Sequence[Effect]: ...

    def simulate(self, point: ModelPoint, run: GapRun, *, fast: bool = False) -> dict[str, Array]:
        """Return the noise-free prediction of every channel from the run's inputs, by its name.

        Shape (n,) each, NaN where the model cannot run. `fast` allows a coarser step that changes
        nothing beyond the noise floor.
        """
        ...

    def regimes(self, run: GapRun, side: str) -> dict[str, Mask]:
        """Masks over the samples by regime name, for one side. `rest` must be among them: nothing
        is driven and nothing moves, so that what remains is noise. Masks may overlap."""
        ...


@dataclass(frozen=True, kw_only=True)
class StartReading:
    """A channel that says where a run starts, and by how much that is usually wrong.

    `above` is the channel from which it is counted, if any. A reading outside `low` to `high` says
    nothing of a start: no bench can start there. Where it is not `taken`, a replay starts as
    mounted, give or take the error.
    """

    error: float
    low: float = -math.inf
    high: float = math.inf
    above: str = ""
    taken: bool = True

    def possible(self, value: float) -> bool:
        """Whether a bench can start there."""
        return self.low < value < self.high

    def counted(self, name: str, values: Mapping[str, float]) -> float:
        """The value of this channel, counted from that below it. Raises KeyError without one."""
        return values[name] - (values[self.above] if self.above else 0.0)


@dataclass(frozen=True, kw_only=True)
class Traits:
    """How a plant varies from run to run, and what its runs must be.

    `day`: parameters that vary, with their usual standard deviation as a share of the prior's.
    `environment`: parameter -> channel that measures it at the start of a run; the model carries
    its difference over. `drift`: places that drift within a run, with the usual size in the unit of
    the place. `starts`: channels that say where a run starts, and so its replay. `shortest_s`:
    least duration of a run. `longest_step_s`: longest sample interval. `together`: number of
    replays that are worth running at once, in threads.
    """

    day: Mapping[str, float] = field(default_factory=dict)
    environment: Mapping[str, str] = field(default_factory=dict)
    drift: Mapping[str, float] = field(default_factory=dict)
    starts: Mapping[str, StartReading] = field(default_factory=dict)
    shortest_s: float = 8.0
    longest_step_s: float = math.inf
    together: int = 1


def traits_of(plant: PlantModel) -> Traits:
    """The `traits` of a plant; the defaults where it has none."""
    traits: Traits = getattr(plant, "traits", Traits())
    return traits


@runtime_checkable
class Experimenter(Protocol):
    """What a plant offers for experiments to be proposed."""

    def catalogue(self) -> Sequence[Experiment]:
        """Safe experiments, within the limits of temperature, current and force."""
        ...

    def perform(self, experiment: str, point: ModelPoint, seed: int) -> GapRun:
        """The run that the plant at `point` would give: inputs and noise-free measured channels."""
        ...


@runtime_checkable
class SavesModel(Protocol):
    """A plant that can write a model file, with its covariance where that is known."""

    def save_model(
        self, point: ModelPoint, path: Path, note: str, uncertainty: Uncertainty | None = None
    ) -> None: ...


def nominal_point(plant: PlantModel) -> ModelPoint:
    """Every parameter at its nominal value, and no effect."""
    return ModelPoint({p.name: p.nominal for p in plant.parameters})


def nominal_replay(run: GapRun, plant: PlantModel, *, fast: bool = True) -> dict[str, Array]:
    """Prediction of a run by the nominal model, by channel, (n,) each; `fast` as in `simulate`."""
    return plant.simulate(nominal_point(plant), run, fast=fast)


def moved_parameters(plant: PlantModel, start: ModelPoint, x: Array) -> dict[str, float]:
    """Parameters of a point moved by `x` (p,) prior standard deviations, within their ranges."""
    return {
        q.name: clipped(start.theta.get(q.name, q.nominal) + q.prior_sd * v, q.low, q.high)
        for q, v in zip(plant.parameters, x.tolist(), strict=True)
    }


def clipped(value: float, low: float, high: float) -> float:
    """As `np.clip`, which takes a hundred times as long for one number."""
    return float(min(max(value, low), high))
