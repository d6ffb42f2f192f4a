"""Fig. 9: a cycle of ±10 mm steps, force against deflection."""

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from sim_device.plant.parameters import ParameterSet
from smad.arrays import Array
from smad.control.commands import DriveCurrent, Follow, Step
from smad.control.metrics import peak, step_response
from smad.control.plan import Action, Do, Mark, Plan, UntilDone
from smad.experiments.base import PAPER_CONTROL, Comparison, Experiment, Findings, Options
from smad.experiments.cycle_theory import CycleTheory, SpringLaw, cycle_theory
from smad.experiments.driver import Driver
from smad.experiments.recording import Recording
from smad.report.page import Text
from smad.report.panels import Panels, followed
from smad.report.planes import QUANTITIES, Curve, Plane, Quantity, cycles_of


class CycleOptions(Options, frozen=True, kw_only=True):
    """Settings of fig9-cycle."""

    step_mm: Annotated[float, Meta(ge=1.0, le=15.0)] = 10.0
    heat_s: Annotated[float, Meta(ge=1.0, le=300.0)] = 20.0
    cool_s: Annotated[float, Meta(ge=1.0, le=300.0)] = 30.0
    cycles: Annotated[int, Meta(ge=1, le=20)] = 2


class Fig9Cycle(Experiment[CycleOptions]):
    """X pulls, cools; Y pulls, cools."""

    name = "fig9-cycle"
    title = "Fig. 9: a cycle of ±10 mm"
    needs = frozenset({"displacement_mm", "force_N", "rtd_x_degC", "rtd_y_degC"})
    options_type = CycleOptions

    def plan(self) -> Plan:
        """A step each way, and water on both springs after each; the first cycle has the marks."""
        options = self.options
        actions: list[Action] = [PAPER_CONTROL]
        for cycle in range(1, options.cycles + 1):
            again = "" if cycle == 1 else f" {cycle}"
            for name, target_mm in (("x", options.step_mm), ("y", -options.step_mm)):
                step = Step(displacement_mm=target_mm, duration_s=options.heat_s)
                water = DriveCurrent(pump_x_duty=1.0, pump_y_duty=1.0, duration_s=options.cool_s)
                actions += [
                    Mark(f"{name} heats{again}"),
                    Do(Follow(trajectories=(step,))),
                    UntilDone(options.heat_s + 10.0),
                    Mark(f"{name} cools{again}"),
                    Do(water),
                    UntilDone(options.cool_s + 10.0),
                ]
            actions.append(Mark(f"end{again}"))
        return Plan(self.name, tuple(actions))

    def conduct(self, trial: str, driver: Driver) -> Recording:
        return driver.run(self.plan())

    def conclude(self, outcomes: Mapping[str, Any], model: ParameterSet) -> Findings:
        run: Recording = outcomes[self.name]
        theory = cycle_theory(model)
        mounted_mm = model["initial_deflection"] * 1e3
        pull = run.between("x heats", "x cools")
        full_mm, full_N = _extreme(pull)
        back_mm, back_N = _last(run.between("x cools", "y heats"))
        reverse_mm, reverse_N = _extreme(run.between("y heats", "y cools"))
        end_mm, end_N = _last(run.between("y cools", "end"))
        response = step_response(pull.t_s, pull["displacement_mm"], self.options.step_mm, start=0.0)
        away_N = deviation(run, theory, model)
        return Findings(
            (
                Comparison(
                    "Fig. 9: Y meets the martensite curve at ξ_X =",
                    "0.27",
                    f"{theory.xi_at_curve:.3f} ({theory.curve_force_N:.3f} N)",
                    "from Eq. (32); a bench has no sensor for ξ",
                    "moduli",
                ),
                Comparison(
                    "Fig. 9: stroke of X, and force there",
                    "+10 mm",
                    f"{full_mm:+.2f} mm, {full_N:.3f} N",
                    f"Eq. (35) at ξ_X = 0: {theory.full_deflection_m * 1e3 - mounted_mm:+.2f} mm, "
                    f"{theory.full_force_N:.3f} N",
                    "stroke",
                ),
                Comparison(
                    "Fig. 9: after X cools, deflection of Y",
                    "“unloads”",
                    f"{mounted_mm + back_mm:.2f} mm, {back_N:.3f} N",
                    f"Eq. (36): {theory.back_deflection_m * 1e3:.2f} mm, "
                    f"{theory.back_force_N:.3f} N",
                ),
                Comparison(
                    "Fig. 9: reverse stroke; after Y cools",
                    "−10 mm; “unloads”",
                    f"{reverse_mm:+.2f} mm, {reverse_N:.3f} N; {end_mm:+.2f} mm, {end_N:.3f} N",
                ),
                *closure(run, self.options.cycles),
                Comparison(
                    "Fig. 9: step of +10 mm",
                    "not given",
                    f"rise {response.rise_time_s:.2f} s, settling "
                    f"{response.settling_time_s:.2f} s, "
                    f"overshoot {response.overshoot_fraction * 100:.1f} %",
                ),
                Comparison(
                    "Eqs (29)–(36) against the run, first half of the cycle",
                    "“similar trend … same value range”",
                    f"largest distance {away_N * 1e3:.0f} mN of {full_N:.2f} N",
                    "closed form of the printed equations, apart from the plant's solver",
                ),
            ),
            (
                Panels(
                    [followed(run.t_s - run.t_s[0], run.columns)],
                    caption=_CAPTION,
                    planes=[_plane(run, theory, model)],
                ),
                Text(
                    "The printed Eq. (13a) has no condition on temperature. Used below M_S it "
                    "would go on to detwin a spring that only cools, and step 4 would not start "
                    "from where step 3 ends; with T > M_S the cycle closes.",
                    "note",
                ),
            ),
        )


_CAPTION = (
    "Force against the deflection of spring Y: the run by cycles, and the paper's loop: steps 1 to "
    "3 in closed form, Eqs (32), (35), (36), between its two characteristic curves. The paper "
    "gives its measured loop as a drawing only."
)


def closure(run: Recording, cycles: int) -> list[Comparison]:
    """How well the cycle closes: displacement after Y has cooled, one cycle after the other."""
    if cycles < 2:
        return []
    ends = [("y cools", "end"), *((f"y cools {k}", f"end {k}") for k in range(2, cycles + 1))]
    places = [_last(run.between(*marks))[0] for marks in ends]
    drift_mm = max(abs(b - a) for a, b in pairwise(places))
    return [
        Comparison(
            "Fig. 9: end of one cycle against the end of the next",
            "one cycle shown",
            f"{drift_mm * 1e3:.0f} µm apart",
            "the first cycle starts from the mounted state, the later ones close",
            "step 4",
        )
    ]


def deviation(run: Recording, theory: CycleTheory, model: ParameterSet) -> float:
    """Largest difference in force, N, between the run and the closed form while X works.

    At equal deflection, separately for loading and unloading, away from the ends of each by 0.3 mm;
    nan for a run that moved less.
    """
    mounted_mm = model["initial_deflection"] * 1e3
    top = int(np.argmax(theory.deflection_m))
    apart = []
    for part, path in (
        (run.between("x heats", "x cools"), slice(0, top + 1)),
        (run.between("x cools", "y heats"), slice(top, None)),
    ):
        delta, force = theory.deflection_m[path] * 1e3, theory.force_N[path]
        order = np.argsort(delta)
        measured_mm = mounted_mm + part["displacement_mm"]
        inside = (measured_mm > delta.min() + 0.3) & (measured_mm < delta.max() - 0.3)
        expected = np.interp(measured_mm[inside], delta[order], force[order])
        apart.append(np.abs(part["force_N"][inside] - expected))
    return peak(np.concatenate(apart))


def _extreme(part: Recording) -> tuple[float, float]:
    """Displacement of largest magnitude in mm, and the force there in N, each a mean of 0.2 s."""
    displacement = part["displacement_mm"]
    k = int(np.nanargmax(np.abs(displacement)))
    near = slice(max(0, k - 10), k + 10)
    return float(np.nanmean(displacement[near])), float(np.nanmean(part["force_N"][near]))


def _last(part: Recording) -> tuple[float, float]:
    """Displacement in mm and force in N at the end, means of the last half second."""
    return (
        float(np.nanmean(part["displacement_mm"][-50:])),
        float(np.nanmean(part["force_N"][-50:])),
    )


def characteristic_curves(model: ParameterSet, top_N: float) -> tuple[Array, Array, Array]:
    """Force in N, and deflection in m on the martensite and on the austenite curve."""
    law, force = SpringLaw(model), np.linspace(0.0, top_N, 200)
    return force, law.characteristic(force), force / law.k_a


def _plane(run: Recording, theory: CycleTheory, model: ParameterSet) -> Plane:
    mounted_mm = model["initial_deflection"] * 1e3
    force, martensite, austenite = characteristic_curves(model, 1.05 * theory.full_force_N)
    deflection_mm, force_N = theory.deflection_m * 1e3, theory.force_N
    curves = []
    for phase, bend, dash in (("martensite", martensite, (2, 3)), ("austenite", austenite, (6, 4))):
        within = (bend * 1e3 > 10.0) & (bend * 1e3 < 40.0)
        x, y = bend[within] * 1e3, force[within]
        curves.append(Curve(label=f"{phase} curve", pen="reference", dash=dash, x=x, y=y))
    curves += [
        Curve(
            label="run",
            pen="main",
            x=mounted_mm + run["displacement_mm"],
            y=run["force_N"],
            t=run.t_s - run.t_s[0],
            cycle=cycles_of(run.columns),
        ),
        Curve(label="the paper's Eqs (32)–(36)", pen="text", x=deflection_mm, y=force_N),
    ]
    deflection = Quantity("deflection of Y", "mm", 2, 0.1)
    return Plane("The paper's loop beside this one", deflection, QUANTITIES["force_N"], curves)
