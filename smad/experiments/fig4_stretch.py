"""Fig. 4: a spring stretched cold and warm gives the moduli and the detwinning stresses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from sim_device.plant.parameters import ParameterSet, spring_factors
from sim_device.plant.units import ZERO_C
from smad.arrays import Array, Index
from smad.control.commands import HoldTemperature, MoveStage
from smad.control.plan import Do, Mark, Pause, Plan
from smad.experiments.base import Comparison, Experiment, Findings, Options
from smad.experiments.cycle_theory import detwinned, stiffnesses
from smad.experiments.driver import Driver, Mounting
from smad.experiments.errors import ExperimentError
from smad.experiments.estimate import Estimate, Tolerance, bootstrap, estimates_from
from smad.experiments.recording import Recording
from smad.report.page import Picture, Text
from smad.report.plots import draw, label, new_figure, picture

POINTS = 400
"""The stretch is averaged to so many points before it is fitted: 95 s at 100 Hz hold far more."""
_GRID = 600
_OF_MARTENSITE = {
    "modulus_martensite": Tolerance(share=0.03),
    "stress_start": Tolerance(share=0.05),
    "stress_finish": Tolerance(share=0.05),
    "max_deflection": Tolerance(share=0.05),
}
_OF_AUSTENITE = {"modulus_austenite": Tolerance(share=0.03)}


class StretchOptions(Options, frozen=True, kw_only=True):
    """Settings of fig4-stretch."""

    stretch_mm: Annotated[float, Meta(ge=10.0, le=150.0)] = 95.0
    rate_mm_per_s: Annotated[float, Meta(gt=0.0, le=20.0)] = 1.0
    cold_degC: Annotated[float, Meta(ge=0.0, le=60.0)] = 25.0
    warm_degC: Annotated[float, Meta(ge=30.0, le=80.0)] = 60.0
    settle_s: Annotated[float, Meta(ge=0.0, le=600.0)] = 20.0


@dataclass(frozen=True)
class Curve:
    """Deflection in m and force in N of one stretch, and the mean temperature in °C."""

    deflection_m: Array
    force_N: Array
    temperature_degC: float


class Fig4Stretch(Experiment[StretchOptions]):
    """Isothermal stretches in martensite and in austenite."""

    name = "fig4-stretch"
    title = "Fig. 4: stretching a spring cold and warm"
    needs = frozenset({"force_N", "displacement_mm", "rtd_x_degC", "stage"})
    options_type = StretchOptions

    def mountings(self) -> frozenset[Mounting]:
        return frozenset({Mounting("stretch")})

    def trials(self) -> tuple[str, ...]:
        return ("fig4-stretch/cold", "fig4-stretch/warm")

    def plan(self, trial: str) -> Plan:
        """Bring the spring to its temperature, hold it there and stretch."""
        options = self.options
        warm = trial.endswith("warm")
        target_degC = options.warm_degC if warm else options.cold_degC
        return Plan(
            trial,
            (
                Do(HoldTemperature(spring="x", temperature_degC=target_degC)),
                Pause(options.settle_s + (60.0 if warm else 0.0)),
                Mark("stretch"),
                Do(MoveStage(stage_mm=options.stretch_mm, rate_mm_per_s=options.rate_mm_per_s)),
                # A held temperature never ends by itself, so the stage's way is waited for by time.
                Pause(options.stretch_mm / options.rate_mm_per_s),
                Mark("end"),
            ),
            fixture="stretch",
        )

    def conduct(self, trial: str, driver: Driver) -> Curve:
        return curve_of(driver.run(self.plan(trial)))

    def conclude(self, outcomes: Mapping[str, Any], model: ParameterSet) -> Findings:
        cold: Curve = outcomes["fig4-stretch/cold"]
        warm: Curve = outcomes["fig4-stretch/warm"]
        estimates = [*martensite(cold, model), *austenite(warm, model)]
        fitted = model.replace(**{estimate.name: estimate.value for estimate in estimates})
        return Findings(
            _comparisons(cold, warm, fitted),
            (
                _figure(cold, warm, fitted),
                Text(
                    f"The cold stretch was done at {cold.temperature_degC:.2f} °C: a bench "
                    "cannot cool a spring below its water. The paper's 25 °C and this temperature "
                    "are both below A_S and M_F, so the curve is the same."
                ),
            ),
            estimates,
        )


_CAPTION = (
    "Force against deflection. Lines: the constitutive law, Eqs (9), (12), with the values found."
)


def curve_of(recording: Recording) -> Curve:
    """The stretch, averaged to at most `POINTS` points of equal numbers of samples."""
    part = recording.between("stretch", "end")
    deflection, force = part["displacement_mm"] * 1e-3, part["force_N"]
    moving = np.isfinite(force) & (deflection > 1e-4) & (deflection < np.nanmax(deflection) - 1e-4)
    if moving.sum() < 50:
        raise ExperimentError(
            "the stretch has too few samples with a force reading",
            value=int(moving.sum()),
            limit="at least 50",
            action="check the stage and the force sensor",
        )
    parts = min(POINTS, int(moving.sum()))
    return Curve(
        _averaged(deflection[moving], parts),
        _averaged(force[moving], parts),
        float(np.nanmean(part["rtd_x_degC"])),
    )


def _averaged(values: Array, parts: int) -> Array:
    return np.array([chunk.mean() for chunk in np.array_split(values, parts)])


def martensite(curve: Curve, model: ParameterSet) -> list[Estimate]:
    """G_M, τ_s, τ_f and δ_L from a stretch below A_S.

    Least squares of the force along δ = F/k_M + δ_L g(b), b = (τ − τ_s)/(τ_f − τ_s), which is
    Eq. (9) with Eq. (12) for a spring of martensite. Geometry from `model`; intervals by block
    bootstrap. Raises ExperimentError when the curve shows no plateau.
    """
    from scipy.optimize import curve_fit

    c1, c2 = spring_factors(model)
    delta, force = curve.deflection_m, curve.force_N
    early = force < 0.25 * force.max()
    k_start = float(np.sum(force[early] * delta[early]) / np.sum(delta[early] ** 2))
    if k_start * delta[-1] < 1.2 * force[-1]:
        raise ExperimentError(
            "the cold stretch shows no detwinning plateau",
            value=f"{force[-1]:.3g} N at {delta[-1] * 1e3:.3g} mm",
            limit=f"well below the {k_start * delta[-1]:.3g} N of a straight line",
            action="stretch further, or check that the spring is below A_S",
        )
    slack = delta[-1] - force[-1] / k_start
    start = (k_start, 0.4 * force[-1], force[-1], slack)

    def fit(chosen: Index) -> Sequence[float]:
        order = np.sort(chosen)
        fitted, _ = curve_fit(_martensite_force, delta[order], force[order], p0=start, maxfev=4000)
        k_m, f_s, f_f, delta_l = fitted
        return k_m * c1 / c2, f_s * c1, f_f * c1, delta_l

    intervals = bootstrap(fit, delta.size, seed=4, repeats=100)
    return estimates_from(_OF_MARTENSITE, intervals, "fig4-stretch, cold")


def _martensite_force(delta: Array, k_m: float, f_s: float, f_f: float, delta_l: float) -> Array:
    f_f = max(f_f, f_s + 1e-3)
    force = np.linspace(0.0, 1.5 * f_f, _GRID)
    way = force / k_m + delta_l * detwinned(force, f_s, f_f)
    return np.interp(delta, way, force)


def austenite(curve: Curve, model: ParameterSet) -> list[Estimate]:
    """G_A from the linear part of a stretch above A_F, by regression; the spring law is Eq. (9).

    The linear part ends where stress makes martensite, near τ_s + C_M(T − M_S); half of that stress
    is used. Raises ExperimentError when too little of the curve lies below it.
    """
    c1, c2 = spring_factors(model)
    stress = model["stress_start"] + model["slope_martensite"] * (
        curve.temperature_degC + ZERO_C - model["martensite_start"]
    )
    linear = np.flatnonzero(curve.force_N * c1 < 0.5 * stress)
    if linear.size < 20:
        raise ExperimentError(
            "the warm stretch has no linear part",
            value=f"{linear.size} points below {0.5e-6 * stress:.0f} MPa",
            limit="at least 20 points",
            action="check that the spring was held above A_F",
        )
    delta, force = curve.deflection_m[linear], curve.force_N[linear]

    def fit(chosen: Index) -> Sequence[float]:
        slope, _ = np.polyfit(delta[chosen], force[chosen], 1)
        return (slope * c1 / c2,)

    intervals = bootstrap(fit, delta.size, seed=5)
    return estimates_from(_OF_AUSTENITE, intervals, "fig4-stretch, warm")


def _comparisons(cold: Curve, warm: Curve, fitted: ParameterSet) -> list[Comparison]:
    k_m, k_a = stiffnesses(fitted)
    return [
        Comparison(
            "Fig. 4: stiffness cold, warm; G_M, G_A",
            "not given (Table 1 is missing); 58.5 and 116.2 N/m derived",
            f"{k_m:.1f}, {k_a:.1f} N/m; {fitted['modulus_martensite'] / 1e9:.2f}, "
            f"{fitted['modulus_austenite'] / 1e9:.2f} GPa",
            "a stretch gives only G/N; N = 20 is assumed",
        ),
        Comparison(
            "Fig. 4: force at full stretch, cold and warm",
            "95 mm; forces not printed",
            f"{cold.force_N[-1]:.2f} N, {warm.force_N[-1]:.2f} N at "
            f"{cold.deflection_m[-1] * 1e3:.0f} mm",
        ),
    ]


def _figure(cold: Curve, warm: Curve, fitted: ParameterSet) -> Picture:
    c1, _ = spring_factors(fitted)
    k_m, k_a = stiffnesses(fitted)
    figure, (axes,) = new_figure(height_in=3.4)
    draw(axes, cold.deflection_m * 1e3, cold.force_N, "cold, measured", "y", width=2.5)
    draw(axes, warm.deflection_m * 1e3, warm.force_N, "warm, measured", "x", width=2.5)
    force_N = _martensite_force(
        cold.deflection_m,
        k_m,
        fitted["stress_start"] / c1,
        fitted["stress_finish"] / c1,
        fitted["max_deflection"],
    )
    draw(axes, cold.deflection_m * 1e3, force_N, "martensite, fitted", "text", style="--")
    straight = warm.deflection_m < 0.035
    draw(
        axes,
        warm.deflection_m[straight] * 1e3,
        warm.deflection_m[straight] * k_a,
        "austenite, fitted",
        "text",
        style=":",
    )
    label(axes, "deflection, mm", "force, N")
    return picture(figure, "Force against deflection of a spring stretched cold and warm", _CAPTION)
