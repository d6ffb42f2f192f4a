"""What an experiment is, and what it finds."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, TypeVar

import msgspec
from msgspec import Struct

from firmware_protocol.nearest import instead
from sim_device.plant.parameters import ParameterSet
from smad.config.bounds import field_and_words
from smad.control.commands import Tune
from smad.control.plan import Do
from smad.experiments.contradictions import reference
from smad.experiments.driver import PARTS, Driver, Mounting
from smad.experiments.errors import BenchLacksError, ExperimentError
from smad.experiments.estimate import Estimate
from smad.report.page import Block

PAPER_CONTROL = Do(
    Tune(current_limit_A=4.0, cooling="proportional", feedforward=False, drain_before_heating=False)
)
"""The control of all tracking runs: the configured gains, 4 A, duty |u|/4 A on the other pump."""


class Options(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The settings of an experiment, with units in the names."""


@dataclass(frozen=True)
class Comparison:
    """One row of the comparison with the paper.

    `contradiction` is a key of `smad.experiments.contradictions.CONTRADICTIONS`, or empty; another
    one raises KeyError.
    """

    fact: str
    paper: str
    here: str
    note: str = ""
    contradiction: str = ""

    def __post_init__(self) -> None:
        if self.contradiction:
            reference(self.contradiction)


@dataclass(frozen=True)
class Findings:
    """What an experiment found: rows for the table, blocks for its section, parameters."""

    comparisons: Sequence[Comparison]
    blocks: Sequence[Block]
    estimates: Sequence[Estimate] = ()


O = TypeVar("O", bound=Options)  # noqa: E741


class Experiment(ABC, Generic[O]):
    """One experiment of the paper.

    `trials` are its independent pieces, which may run in different processes; `conduct` carries
    one out on a driver and returns what `conclude` needs of it (picklable). `conclude` gets the
    outcomes by trial and the parameters of the model to compare with.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    needs: ClassVar[frozenset[str]]
    options_type: ClassVar[type[Options]]

    def __init__(self, options: O) -> None:
        self.options = options

    def requirements(self) -> frozenset[str]:
        """Parts that it needs with its present options; `needs` at least."""
        return self.needs

    def mountings(self) -> frozenset[Mounting]:
        """All mountings that its runs use."""
        return frozenset({Mounting()})

    def trials(self) -> tuple[str, ...]:
        """Names of the independent pieces."""
        return (self.name,)

    @abstractmethod
    def conduct(self, trial: str, driver: Driver) -> Any:
        """Carry out one trial."""

    @abstractmethod
    def conclude(self, outcomes: Mapping[str, Any], model: ParameterSet) -> Findings:
        """Analyse the outcomes of all trials."""

    def check(self, driver: Driver) -> None:
        """Raise BenchLacksError, naming what is missing, unless the bench has all of it."""
        mounted = driver.mounting()
        other_mountings = [] if mounted is None else sorted(self.mountings() - {mounted})
        if other_mountings:
            raise BenchLacksError(
                f"experiment {self.name} needs another mounting of the springs",
                value=str(mounted),
                limit="; ".join(map(str, other_mountings)),
                action="nothing was moved; mount them that way and give --fixture and --air, or "
                "leave those runs out with --set",
            )
        lacking = sorted(self.requirements() - driver.parts())
        if lacking:
            raise BenchLacksError(
                f"experiment {self.name} cannot be run: this bench lacks "
                + " and ".join(PARTS[part] for part in lacking),
                value=", ".join(lacking),
                action="nothing was moved; fit what is missing, or run another experiment",
            )

    def run(self, driver: Driver, model: ParameterSet) -> Findings:
        """Everything, one trial after the other. Raises BenchLacksError before anything moves."""
        self.check(driver)
        outcomes = {trial: self.conduct(trial, driver) for trial in self.trials()}
        return self.conclude(outcomes, model)


def options_from(kind: type[Options], settings: Mapping[str, Any], experiment: str) -> Options:
    """The options with these settings (values may be text, as from the command line).

    Raises ExperimentError, naming the setting, for an unknown one or a value out of its range.
    """
    try:
        options: Options = msgspec.convert(settings, type=kind, strict=False)
    except msgspec.ValidationError as refused:
        names = [field.name for field in msgspec.structs.fields(kind)]
        foreign = next((name for name in settings if name not in names), None)
        see = f"see smad docs experiments/{experiment}"
        if foreign is not None:
            raise ExperimentError(
                f"{experiment} has no setting {foreign}",
                action=f"{instead(foreign, names)} ({see})",
            ) from None
        field, words = field_and_words(str(refused))
        raise ExperimentError(
            f"{experiment}: {field or 'a setting'} is not valid: {words}",
            value=settings.get(field, dict(settings)),
            action=see,
        ) from None
    return options
