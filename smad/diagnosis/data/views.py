"""Which views of a plant some runs can be replayed in, and judged by."""

from __future__ import annotations

from collections.abc import Sequence

from smad.diagnosis.plant import Array, PlantModel, View, nominal_point
from smad.diagnosis.runs import GapRun


def lacking_feeds(view: View, run: GapRun) -> list[str]:
    """What a view is fed with and a run does not have."""
    return [f for f in view.feeds if f not in run.outputs and f not in run.inputs]


def supported_keys(views: Sequence[View], run: GapRun) -> set[str]:
    """Keys of the outputs that a run has, together with what their views are fed with."""
    fed = [v for v in views if not lacking_feeds(v, run)]
    return {o.key for v in fed for o in v.outputs if o.channel in run.outputs}


def local_views(plant: PlantModel) -> list[View]:
    """The local views of a plant, upstream first."""
    return [v for v in plant.views if not v.open_loop]


def open_views(plant: PlantModel) -> list[View]:
    """The open-loop view of a plant, in a list."""
    return [v for v in plant.views if v.open_loop]


def nominal_replay(run: GapRun, plant: PlantModel) -> dict[str, Array]:
    """What the nominal model predicts of a run in its open loop, by channel."""
    views = open_views(plant)
    values = plant.simulate(nominal_point(plant), run, [v.name for v in views], fast=True)
    return {o.channel: values[o.key] for v in views for o in v.outputs if o.key in values}
