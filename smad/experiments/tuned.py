"""From the recorded experiment to gains, and how a trial with them went."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from smad.config import ControlConfig
from smad.control.commands import Spring, Tune
from smad.control.metrics import ripple, rms, starts, tracking_r2
from smad.control.tuning.errors import TuningError
from smad.control.tuning.identify import (
    LEAST_PULL_MM,
    MOST_DRIFT_PER_S,
    Cooling,
    Stillness,
    cooled,
    pulled,
    stillness,
)
from smad.control.tuning.plans import SPRINGS, START_MM, TRIAL_CYCLES, TRIAL_MM, TRIAL_PERIOD_S
from smad.control.tuning.rules import NOISE_A, Gains, Lag, Margins, band_mm, gains_for, margins_of
from smad.experiments.recording import Recording

REACH_MM = 0.5


@dataclass(frozen=True)
class Tuned:
    """The outcome: models by direction, gains now and by the rule, their margins at full current.

    `band_mm` is 0 for a temperature loop.
    """

    loop: str
    noise: Stillness
    models: Mapping[Spring, Lag]
    cooling: Mapping[Spring, Cooling]
    before: Gains
    after: Gains
    margins_before: Margins
    margins_after: Margins
    band_mm: float = 0.0

    def command(self, gains: Gains) -> Tune:
        """The command that puts these gains in force."""
        if self.loop == "temperature":
            return Tune(temperature_kp_A_per_K=gains.kp, temperature_ki_A_per_K_s=gains.ki)
        return Tune(kp_A_per_mm=gains.kp, ki_A_per_mm_s=gains.ki)

    def toml(self) -> str:
        """The section of the configuration to keep."""
        if self.loop == "temperature":
            return (
                f"[control.temperature]\nkp_A_per_K = {self.after.kp}\n"
                f"ki_A_per_K_s = {self.after.ki}\n"
            )
        return (
            f"[control]\nkp_A_per_mm = {self.after.kp}\nki_A_per_mm_s = {self.after.ki}\n\n"
            f"[control.hold]\nband_mm = {self.band_mm:g}\n"
        )


def tuned_displacement(run: Recording, config: ControlConfig) -> Tuned:
    """Gains of the displacement loop. Raises TuningError with the reason why not."""
    rest = run.between("still", "moving")
    still = stillness(
        rest["t_s"],
        rest["displacement_mm"],
        "displacement (mm)",
        MOST_DRIFT_PER_S["displacement_mm"],
    )
    models: dict[Spring, Lag] = {}
    cooling: dict[Spring, Cooling] = {}
    for spring, sign in zip(SPRINGS, (1.0, -1.0), strict=True):
        part = run.between(f"{spring} pulses", f"{spring} cools")
        at_mm = float(np.nanmean(part["displacement_mm"][:5]))
        if abs(at_mm - sign * START_MM) > REACH_MM:
            raise TuningError(
                f"spring {spring} did not come to where the pulses begin",
                value=f"{at_mm:.2f} mm",
                limit=f"within {REACH_MM:g} mm of {sign * START_MM:g} mm",
                action="the bench is too weak, too warm, or its present gains are far off",
            )
        model = pulled(
            part["t_s"],
            sign * part["displacement_mm"],
            part[f"i_applied_{spring}_A"],
            part[f"i_cmd_{spring}_A"],
            f"spring {spring}",
        )
        stroke_mm = sign * float(part["displacement_mm"][-1] - part["displacement_mm"][0])
        if stroke_mm < LEAST_PULL_MM:
            raise TuningError(
                f"spring {spring} hardly pulls",
                value=f"{stroke_mm:.2f} mm in the pulses",
                limit=f"at least {LEAST_PULL_MM:g} mm",
                action="check tendon, heater and the current limit",
            )
        models[spring] = model
        cold = run.between(f"{spring} cools", f"{spring} cooled")
        cooling[spring] = cooled(
            cold["t_s"], cold[f"rtd_{spring}_degC"], cold["rtd_inlet_degC"], f"spring {spring}"
        )
    period_s = float(np.median(np.diff(rest["t_s"])))
    band = max(
        config.hold.band_mm, band_mm(still.count, still.noise, period_s, config.hold.smooth_s)
    )
    before = Gains(config.kp_A_per_mm, config.ki_A_per_mm_s)
    tuned = _tuned("displacement", still, models, before, config.current_limit_A)
    return replace(tuned, cooling=cooling, band_mm=band)


def tuned_temperature(run: Recording, config: ControlConfig, spring: Spring) -> Tuned:
    """Gains of the temperature loop, from one spring. Raises TuningError with the reason."""
    name = f"rtd_{spring}_degC"
    rest = run.between("still", "moving")
    still = stillness(
        rest["t_s"],
        rest[name],
        f"temperature of spring {spring} (K)",
        MOST_DRIFT_PER_S["temperature"],
    )
    part = run.between("moving", f"{spring} cools")
    model = pulled(
        part["t_s"],
        part[name],
        part[f"i_applied_{spring}_A"],
        part[f"i_cmd_{spring}_A"],
        f"temperature of spring {spring}",
    )
    before = Gains(config.temperature.kp_A_per_K, config.temperature.ki_A_per_K_s)
    return _tuned("temperature", still, {spring: model}, before, config.current_limit_A)


def _tuned(
    loop: str, still: Stillness, models: Mapping[Spring, Lag], before: Gains, limit_A: float
) -> Tuned:
    quick = max(models.values(), key=lambda model: model.gain / model.at_A)
    # The sensor's noise, or what its steps amount to where they are coarser.
    noise = max(still.noise, still.count / math.sqrt(12.0))
    after = gains_for(quick, noise, NOISE_A[loop])
    full = quick.scaled_to(limit_A)
    margins = margins_of(full, before), margins_of(full, after)
    return Tuned(loop, still, models, {}, before, after, *margins)


@dataclass(frozen=True)
class Trial:
    """How a trial of ±2 mm went: the sinusoid after its first cycle, the steps, the holds."""

    r2: float
    overshoot_mm: float
    error_rms_um: float
    ripple_mA: float
    pump_starts: int


def trial_of(run: Recording) -> Trial:
    """The trial of displacement from its samples. Raises ExperimentError when it ended early."""
    part = run.between("trial", "end")
    t = part["t_s"] - part["t_s"][0]
    reference, actual = part["reference_mm"], part["displacement_mm"]
    signed_A = part["i_applied_x_A"] - part["i_applied_y_A"]
    sine_s = TRIAL_CYCLES * TRIAL_PERIOD_S
    later = (t > TRIAL_PERIOD_S) & (t <= sine_s)
    overshoot, errors, ripples = [], [], []
    for first, sign in ((sine_s, 1.0), (sine_s + 8.0, -1.0)):
        step = (t > first + 0.05) & (t <= first + 7.9)
        overshoot.append(float(np.nanmax(sign * actual[step])) - TRIAL_MM)
        at_rest = (t > first + 5.0) & (t <= first + 7.9)
        errors.append(1e3 * rms((reference - actual)[at_rest]))
        ripples.append(1e3 * ripple(t[at_rest], signed_A[at_rest]))
    return Trial(
        tracking_r2(reference[later], actual[later]),
        max(overshoot),
        max(errors),
        max(ripples),
        starts(part["duty_x"]) + starts(part["duty_y"]),
    )


@dataclass(frozen=True)
class WarmTrial:
    """How a step of temperature went."""

    settling_s: float
    overshoot_K: float
    error_rms_K: float
    ripple_mA: float


def warm_trial_of(run: Recording, spring: Spring) -> WarmTrial:
    """The trial of temperature from its samples. Raises ExperimentError when it ended early."""
    part = run.between("trial", "end")
    t = part["t_s"] - part["t_s"][0]
    error = part["reference_degC"] - part[f"rtd_{spring}_degC"]
    out = np.flatnonzero(np.abs(error) > 0.5)
    settled = float(t[out[-1]]) if out.size and out[-1] < t.size - 1 else math.nan
    late = t > t[-1] - 5.0
    shaken_mA = 1e3 * ripple(t[late], part[f"i_applied_{spring}_A"][late])
    return WarmTrial(settled, max(0.0, -float(np.nanmin(error))), rms(error[late]), shaken_mA)
