"""The experiments by name. Each module is imported only when its experiment is asked for."""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any

from msgspec import Struct

from firmware_protocol.nearest import instead
from smad.experiments.base import Experiment, options_from
from smad.experiments.driver import PARTS
from smad.experiments.errors import ExperimentError

EXPERIMENTS: Mapping[str, str] = {
    "dsc": "smad.experiments.dsc:Dsc",
    "resistance": "smad.experiments.resistance:Resistance",
    "fig4-stretch": "smad.experiments.fig4_stretch:Fig4Stretch",
    "fig5-block": "smad.experiments.fig5_block:Fig5Block",
    "fig9-cycle": "smad.experiments.fig9_cycle:Fig9Cycle",
    "fig10-thermal": "smad.experiments.fig10_thermal:Fig10Thermal",
    "fig11-tracking": "smad.experiments.fig11_tracking:Fig11Tracking",
    "fig12-frequency": "smad.experiments.fig12_frequency:Fig12Frequency",
    "fig13-segment": "smad.experiments.fig13_segment:Fig13Segment",
}
"""In the order of the report. What recovers parameters comes first; later analyses use them."""


ALL = "all"


def make_experiment(name: str, settings: Mapping[str, Any] | None = None) -> Experiment[Any]:
    """The experiment of that name. Raises ExperimentError for an unknown name or setting."""
    if name not in EXPERIMENTS:
        raise ExperimentError(
            "there is no such experiment",
            value=name,
            action=f"{instead(name, EXPERIMENTS)} (smad run --list shows what each needs)",
        )
    module, _, attribute = EXPERIMENTS[name].partition(":")
    kind: type[Experiment[Any]] = getattr(importlib.import_module(module), attribute)
    return kind(options_from(kind.options_type, settings or {}, name))


class ExperimentSummary(Struct, frozen=True):
    """An experiment as lists show it: `needs` are the parts of the bench without which it fails."""

    name: str
    title: str
    needs: list[str]

    @property
    def needs_in_words(self) -> str:
        """The parts by their titles; without one it analyses a file."""
        return ", ".join(PARTS[part] for part in self.needs) or "a data file"


def experiment_summaries() -> list[ExperimentSummary]:
    """All experiments, in the order of the report."""
    experiments = [make_experiment(name) for name in EXPERIMENTS]
    return [ExperimentSummary(e.name, e.title, sorted(e.requirements())) for e in experiments]


def whole_names(words: Sequence[str]) -> list[str]:
    """Return the words with a shortened experiment's name made whole: `fig11` is fig11-tracking."""
    fitting = [name for name in EXPERIMENTS if words and name.startswith(words[0])]
    return [*fitting, *words[1:]] if len(fitting) == 1 else [*words]


def chosen_experiments(names: Sequence[str], settings: Sequence[str] = ()) -> list[Experiment[Any]]:
    """The experiments of these names, or of `all`, with settings `[EXPERIMENT.]KEY=VALUE`.

    They come in the order of the report. Raises ExperimentError.
    """
    if not names:
        raise ExperimentError("name an experiment, or `all`", action="smad run --list shows them")
    chosen = [name for name in EXPERIMENTS if ALL in names or name in names]
    for name in names:
        if name != ALL and name not in EXPERIMENTS:
            make_experiment(name)
    options: dict[str, dict[str, Any]] = {name: {} for name in chosen}
    for setting in settings:
        target, equals, value = setting.partition("=")
        name, dot, key = target.rpartition(".")
        if not dot and len(chosen) == 1:
            name = chosen[0]
        if not equals or name not in options:
            raise ExperimentError(
                "this is not a setting of an experiment that runs",
                value=setting,
                action="write EXPERIMENT.KEY=VALUE",
            )
        options[name][key] = value
    return [make_experiment(name, options[name]) for name in chosen]
