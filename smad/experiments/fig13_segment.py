"""Figs 13 and 14: ±4 mm of the springs turn the robot's end segment by ±25°."""

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from sim_device.plant.parameters import ParameterSet
from smad.config.axes import DEGREES_PER_MM
from smad.control.commands import Follow, Step
from smad.control.metrics import step_response
from smad.control.plan import Action, Do, Mark, Plan, UntilDone
from smad.experiments.base import PAPER_CONTROL, Comparison, Experiment, Findings, Options
from smad.experiments.driver import Driver
from smad.experiments.recording import Recording
from smad.report.page import Text
from smad.report.panels import Panel, Panels, Trace, followed


class SegmentOptions(Options, frozen=True, kw_only=True):
    """Settings of fig13-segment. The gain makes displacements of the angles asked for."""

    angle_deg: Annotated[float, Meta(gt=0.0, le=60.0)] = 25.0
    hold_s: Annotated[float, Meta(ge=0.5, le=300.0)] = 8.0
    cycles: Annotated[int, Meta(ge=1, le=100)] = 2
    gain_deg_per_mm: Annotated[float, Meta(gt=0.0, le=100.0)] = DEGREES_PER_MM


class Fig13Segment(Experiment[SegmentOptions]):
    """Back and forth between the two angles, by way of the middle."""

    name = "fig13-segment"
    title = "Figs 13, 14: the end segment of MINIR-II"
    needs = frozenset({"displacement_mm", "rtd_x_degC", "rtd_y_degC"})
    options_type = SegmentOptions

    @property
    def amplitude_mm(self) -> float:
        """Displacement of the springs at the largest angle."""
        return self.options.angle_deg / self.options.gain_deg_per_mm

    def plan(self) -> Plan:
        """Steps to +angle, 0, −angle, 0."""
        options = self.options
        actions: list[Action] = [PAPER_CONTROL, Mark("begin")]
        for cycle in range(options.cycles):
            for name, share in (("up", 1.0), ("middle", 0.0), ("down", -1.0), ("home", 0.0)):
                level = Step(displacement_mm=share * self.amplitude_mm, duration_s=options.hold_s)
                actions += [
                    Mark(f"{name} {cycle + 1}"),
                    Do(Follow(trajectories=(level,))),
                    UntilDone(options.hold_s + 10.0),
                ]
        return Plan(self.name, (*actions, Mark("end")))

    def conduct(self, trial: str, driver: Driver) -> Recording:
        return driver.run(self.plan()).between("begin", "end")

    def conclude(self, outcomes: Mapping[str, Any], model: ParameterSet) -> Findings:
        run: Recording = outcomes[self.name]
        t, mm = run.t_s - run.t_s[0], run["displacement_mm"]
        angle = model["robot_gain"] * 1e-3 * mm
        last = self.options.cycles
        up = run.between(f"up {last}", f"middle {last}")
        response = step_response(up.t_s, up["displacement_mm"], self.amplitude_mm, start=0.0)
        wanted_mm = self.options.angle_deg / model["robot_gain"] * 1e3
        return Findings(
            (
                Comparison(
                    f"Fig. 13: angle for ±{self.amplitude_mm:g} mm",
                    "about ±25°",
                    f"{float(np.nanmin(angle)):+.1f}° to {float(np.nanmax(angle)):+.1f}° for "
                    f"{float(np.nanmin(mm)):+.2f} to {float(np.nanmax(mm)):+.2f} mm",
                    f"gain {model['robot_gain'] * 1e-3:.2f} °/mm, from the paper's two numbers; "
                    f"{self.options.angle_deg:g}° need {wanted_mm:.2f} mm",
                ),
                Comparison(
                    f"Fig. 13: time to turn by {self.options.angle_deg:g}°",
                    "not printed",
                    f"rise {response.rise_time_s:.2f} s, settling {response.settling_time_s:.2f} s",
                ),
            ),
            (
                Panels(
                    [
                        followed(t, run.columns),
                        Panel("Angle", "°", 1, [Trace("angle of the segment", t, angle, "main")]),
                    ]
                ),
                Text(
                    "A camera measured the angle in the paper. Here it follows from the "
                    "displacement by the gain alone: the robot's own elasticity is not modelled."
                ),
            ),
        )
