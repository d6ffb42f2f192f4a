"""The simulated benches that a configuration describes, a board for each axis."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from smad.errors import SmadError

if TYPE_CHECKING:
    from sim_device.bench import SimulatedBench
    from smad.config import Config

MEGA_RATE_HZ = 100
"""The most that the firmware of the Mega takes; see docs/firmware.md."""


class SimulatorError(SmadError):
    """The simulated bench cannot be run as asked."""


def faults_of(faults: tuple[str, ...], axis: str) -> tuple[str, ...]:
    """Return the faults of one axis: those with its name and a colon before theirs."""
    if not axis:
        return faults
    return tuple(text.removeprefix(f"{axis}:") for text in faults if text.startswith(f"{axis}:"))


def rate_of(rate_hz: int, firmware: str) -> int:
    if firmware == "avr" and rate_hz > MEGA_RATE_HZ:
        raise SimulatorError(
            "the Mega has not the time for so many samples a second",
            value=rate_hz,
            limit=MEGA_RATE_HZ,
            action="take --rate 100, or --firmware host",
        )
    return rate_hz


def build(
    config: Config,
    *,
    rate_hz: int,
    seed: int,
    faults: tuple[str, ...] = (),
    model_path: Path | None = None,
    effects: tuple[str, ...] = (),
    firmware: str = "python",
    store_path: Path | None = None,
    axis: str = "",
) -> SimulatedBench:
    """Return the bench that the configuration describes, with the plant of a model file if given.

    `effects` are added to those of configuration or model, in place of one of the same name.
    `firmware`: "python", or a port of the C firmware, with its parameter memory in `store_path`.
    `axis` is the name that its board stores, if any.

    Raises BenchError and PlantError.
    """
    from sim_device.bench import SimulatedBench
    from sim_device.faults import parse_injection
    from sim_device.plant.effects.registry import from_text
    from sim_device.plant.models import built_in, read_model

    plant = config.plant
    if model_path is None:
        model = replace(built_in(plant.parameter_file or "A"), variant=plant.variant)
        model = model.with_effects(plant.effects)
    else:
        model = read_model(model_path)
    model = model.with_effects(dict(from_text(text) for text in effects))
    make = SimulatedBench if firmware == "python" else _with_firmware(firmware, store_path)
    return make(
        **model.physics,
        fixture=plant.fixture,
        rate_hz=rate_hz,
        seed=seed,
        faults=[parse_injection(text) for text in faults],
        axis_name=axis,
    )


def _with_firmware(port: str, store_path: Path | None) -> Callable[..., SimulatedBench]:
    from sim_device.firmware.bench import firmware_bench

    return functools.partial(firmware_bench, port, store_path=store_path)
