"""Runs of the simulated spring pair in virtual time, through controller, sensors and quanta."""

from collections.abc import Sequence

import numpy as np

from sim_device.plant import Drive, Plant
from smad.config import ControlConfig, LimitsConfig
from smad.control.controller import Controller
from smad.control.sample import Sample
from smad.diagnosis.plant import ModelPoint
from smad.diagnosis.runs import GapRun
from smad.diagnosis.spring_pair.catalogue import timeline_named
from smad.diagnosis.spring_pair.replays import PointReader
from smad.diagnosis.spring_pair.signals import CHANNELS, run_from_columns

RATE_HZ = 100.0
_NAMES = (
    "t_s", "i_applied_x_A", "i_applied_y_A", "duty_x", "duty_y",
    "i_meas_x_A", "i_meas_y_A", "v_x_V", "v_y_V",
    "rtd_x_degC", "rtd_y_degC", "rtd_inlet_degC", "rtd_ambient_degC",
    "displacement_mm", "force_N",
)  # fmt: skip
_CONTROL = ControlConfig(kp_A_per_mm=15.0, ki_A_per_mm_s=3.0)
"""The gains that the experiments of the catalogue were tried with; the shipped ones are quicker."""


def recorded(
    experiment: str,
    model: PointReader,
    point: ModelPoint,
    seed: int,
    *,
    noise: bool = True,
    duration_s: float | None = None,
    rate_hz: float = RATE_HZ,
    past: Sequence[tuple[float, Drive]] = (),
) -> GapRun:
    """The run that a bench at `point` gives for an experiment of the catalogue.

    `seed` draws the experiment's random levels and, with `noise`, the sensors' noise; without it
    the channels are not rounded either. `past` says for how many seconds each drive
    was held before the run. Raises GapError for a name that is not in the catalogue.
    """
    timeline = timeline_named(experiment)
    pending = timeline.commands(seed)
    parameters = model.set_of(point.theta)
    if not noise:
        quiet = ("current", "voltage", "temperature", "displacement", "force")
        parameters = parameters.replace(**{f"noise_{name}": 0.0 for name in quiet})
    plant = Plant(
        parameters, variant=model.variant, effects=model.acting(point), laws=point.laws, seed=seed
    )
    for held_s, drive in past:
        plant.advance(drive, held_s)
    controller = Controller(_CONTROL, LimitsConfig())
    n = round((timeline.duration_s if duration_s is None else duration_s) * rate_hz)
    rows = np.empty((n, len(_NAMES)))
    drive = Drive()
    dt_s = 1.0 / rate_hz
    for k in range(n):
        plant.advance(drive, dt_s)
        read = plant.read()
        rows[k] = (
            (k + 1) * dt_s, *drive.i_A, *drive.pump_duty, *read.i_A, *read.v_V, *read.rtd_degC,
            1e3 * read.displacement_m, read.force_N,
        )  # fmt: skip
        while pending and pending[0][0] <= k * dt_s:
            controller.command(pending.pop(0)[1])
        sample = Sample(
            t_us=round((k + 1) * 1e6 * dt_s),
            tick=(k + 1) & 0xFFFF,
            armed=True,
            displacement_m=read.displacement_m,
            force_N=read.force_N,
            rtd_degC=read.rtd_degC,
            i_meas_A=read.i_A,
            i_applied_A=drive.i_A,
            v_V=read.v_V,
            pump_duty=drive.pump_duty,
            supply_V=read.supply_V,
        )
        output = controller.step(sample)
        drive = Drive(i_A=output.i_A, pump_duty=output.pump_duty, drain=output.drain)
    columns = dict(zip(_NAMES, rows.T, strict=True))
    if noise:
        for c in CHANNELS:
            columns[c.name] = np.round(columns[c.name] / c.quantum) * c.quantum
    return run_from_columns(f"{experiment} {seed}", columns)
