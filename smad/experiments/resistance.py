"""Resistance at room temperature: the resistivity β_s by Eq. (27)."""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from sim_device.plant.parameters import ParameterSet
from smad.arrays import Array, Index
from smad.control.commands import DriveCurrent
from smad.control.plan import Do, Mark, Plan, UntilDone
from smad.experiments.base import Comparison, Experiment, Findings, Options
from smad.experiments.driver import Driver
from smad.experiments.errors import ExperimentError
from smad.experiments.estimate import Estimate, Tolerance, bootstrap, estimates_from
from smad.experiments.recording import Recording
from smad.report.page import Picture
from smad.report.plots import label, new_figure, picture
from smad.style.palette import in_print

LEVELS = 5


class ResistanceOptions(Options, frozen=True, kw_only=True):
    """Settings of resistance. The current is small, so that the spring hardly warms."""

    current_A: Annotated[float, Meta(ge=0.05, le=1.0)] = 0.4
    dwell_s: Annotated[float, Meta(ge=0.2, le=60.0)] = 1.0


class Resistance(Experiment[ResistanceOptions]):
    """Voltage against a staircase of small currents, both springs."""

    name = "resistance"
    title = "Resistance at room temperature"
    needs = frozenset({"v_x_V", "i_meas_x_A", "rtd_x_degC"})
    options_type = ResistanceOptions

    def plan(self) -> Plan:
        """Steps of current from a fifth to the whole, in both springs at once."""
        actions: list[Do | UntilDone | Mark] = [Mark("begin")]
        for step in range(1, LEVELS + 1):
            level_A = self.options.current_A * step / LEVELS
            command = DriveCurrent(i_x_A=level_A, i_y_A=level_A, duration_s=self.options.dwell_s)
            actions += [Do(command), UntilDone(self.options.dwell_s + 5.0)]
        return Plan(self.name, (*actions, Mark("end")))

    def conduct(self, trial: str, driver: Driver) -> Recording:
        return driver.run(self.plan()).between("begin", "end")

    def conclude(self, outcomes: Mapping[str, Any], model: ParameterSet) -> Findings:
        recording: Recording = outcomes[self.name]
        estimate, ohms = resistivity(recording, model)
        warmed_K = float(np.nanmax(recording["rtd_x_degC"]) - np.nanmin(recording["rtd_x_degC"]))
        return Findings(
            (
                Comparison(
                    "Eq. (27): resistance, β_s",
                    "0.76 Ω derived; 0.44 µΩ·m in the sister paper, 0.76–0.82 in the literature",
                    f"{ohms[0]:.4f} Ω (X), {ohms[1]:.4f} Ω (Y); {estimate.value * 1e6:.4f} µΩ·m",
                    f"the springs warmed by at most {warmed_K:.2f} K",
                ),
            ),
            (_figure(recording, ohms),),
            (estimate,),
        )


def resistivity(recording: Recording, model: ParameterSet) -> tuple[Estimate, tuple[float, float]]:
    """β_s = R d_s²/(4 D_s N), Eq. (27), and the resistances of X and Y in ohms.

    Each resistance is the slope of voltage on current, so that offsets of either sensor do not
    count; β_s is from their mean. Raises ExperimentError without a change of current.
    """
    pairs = []
    for spring in "xy":
        i, v = recording[f"i_meas_{spring}_A"], recording[f"v_{spring}_V"]
        flows = np.isfinite(i) & np.isfinite(v) & (recording[f"i_applied_{spring}_A"] > 0.0)
        if flows.sum() < 50 or np.ptp(recording[f"i_applied_{spring}_A"][flows]) < 0.02:
            raise ExperimentError(
                f"the current in spring {spring.upper()} did not change enough for a slope",
                value=f"{int(flows.sum())} samples",
                limit="at least 50 samples, over at least 0.02 A",
                action="check the driver and the current sensor",
            )
        pairs.append((i[flows], v[flows], recording[f"i_applied_{spring}_A"][flows]))
    n = min(len(i) for i, _, _ in pairs)
    factor = model["wire_diameter"] ** 2 / (4.0 * model["coil_diameter"] * model["coils"])

    def slopes(chosen: Index) -> list[float]:
        return [_slope(i[chosen], v[chosen], set_A[chosen]) for i, v, set_A in pairs]

    def fit(chosen: Index) -> Sequence[float]:
        return (math.fsum(slopes(chosen)) / 2.0 * factor,)

    (estimate,) = estimates_from(
        {"resistivity": Tolerance(share=0.03)}, bootstrap(fit, n, seed=27), "resistance"
    )
    ohm_x, ohm_y = slopes(np.arange(n))
    return estimate, (ohm_x, ohm_y)


def _slope(i_A: Array, v_V: Array, set_A: Array) -> float:
    """Slope of V on I with the setpoint as instrument: noise of the current sensor adds no bias."""
    z = set_A - set_A.mean()
    below = float(np.sum(z * (i_A - i_A.mean())))
    if below == 0.0:
        raise ValueError("one level only")
    return float(np.sum(z * (v_V - v_V.mean()))) / below


def _figure(recording: Recording, ohms: tuple[float, float]) -> Picture:
    figure, (axes,) = new_figure(width_in=5.0, height_in=3.0)
    for spring, ohm in zip("xy", ohms, strict=True):
        i, v = recording[f"i_meas_{spring}_A"], recording[f"v_{spring}_V"]
        axes.plot(i[::5], v[::5], ".", color=in_print(spring), markersize=2)
        line = np.array([0.0, float(np.nanmax(i))])
        axes.plot(line, line * ohm, color=in_print(spring), label=f"{spring.upper()}: {ohm:.4f} Ω")
    label(axes, "current, A", "voltage, V")
    return picture(figure, "Voltage against current of both springs", "All samples.")
