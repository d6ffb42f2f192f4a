"""Gains and options in force, as the command that sets them."""

import msgspec

from smad.config import ControlConfig
from smad.control.commands import Tune


def tune_of(config: ControlConfig) -> Tune:
    """Return the command that brings every gain back to the configured one."""
    return Tune(
        kp_A_per_mm=config.kp_A_per_mm,
        ki_A_per_mm_s=config.ki_A_per_mm_s,
        hold_band_mm=config.hold.band_mm,
        temperature_kp_A_per_K=config.temperature.kp_A_per_K,
        temperature_ki_A_per_K_s=config.temperature.ki_A_per_K_s,
        current_limit_A=config.current_limit_A,
        cooling=config.cooling.mode,
        feedforward=config.feedforward.enabled,
        drain_before_heating=config.drain_before_heating,
    )


def tuned(before: Tune, command: Tune, *, most_A: float) -> Tune:
    """Return `before` with the fields of `command` that are not empty; at most `most_A`."""
    fields = {
        name: value
        for name in command.__struct_fields__
        if (value := getattr(command, name)) is not None
    }
    if command.current_limit_A is not None:
        fields["current_limit_A"] = min(most_A, command.current_limit_A)
    return msgspec.structs.replace(before, **fields)
