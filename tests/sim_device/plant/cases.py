"""Drives that the plant's tests share."""

import numpy as np

from sim_device.plant import Inputs
from sim_device.plant.effects.registry import effect
from sim_device.plant.setup import Setup


def alternating(seconds=40.0, amps=3.6, period_s=16.0, heat_s=5.0, step_s=0.01):
    """X and Y heated in turn, each cooled by its pump afterwards."""
    t = np.arange(int(seconds / step_s)) * step_s
    phase_x = t % period_s
    phase_y = (t + period_s / 2) % period_s
    late = t > period_s / 2 - 2
    i_A = np.column_stack([amps * (phase_x < heat_s), amps * (phase_y < heat_s) * late])
    i_A[0] = 0.0
    cool_x = (phase_x > heat_s + 0.5) & (phase_x < period_s - 2)
    cool_y = (phase_y > heat_s + 0.5) & (phase_y < period_s - 2) & late
    return Inputs(t, i_A, 0.8 * np.column_stack([cool_x, cool_y]))


def still(t, **series):
    """No current, no water: for replays that are fed."""
    return Inputs(t, np.zeros((t.size, 2)), np.zeros((t.size, 2)), **series)


def at_level(name, level):
    """Typical values of an effect with every strength times `level`; shapes as they are."""
    return {q.name: q.typical * (level if q.is_strength else 1.0) for q in effect(name).parameters}


def setup_of(parameters, variant="extended", effects=None):
    """The mounted pair in water, as the kernel takes it."""
    return Setup.make(
        parameters,
        variant=variant,
        fixture="antagonistic",
        cooling="water",
        effects=effects or {},
    )


def values_of(parameters):
    """All values of a set, SI, in the order of its names."""
    return [entry.value for entry in parameters.entries]
