"""Fig. 5: a spring heated and cooled between fixed ends gives the slopes C_A and C_M."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from sim_device.plant.parameters import ParameterSet, spring_factors
from sim_device.plant.units import ZERO_C
from smad.arrays import Array, Index
from smad.control.commands import DriveCurrent, HoldTemperature, MoveStage
from smad.control.plan import Do, Mark, Pause, Plan, UntilDone
from smad.experiments.base import Comparison, Experiment, Findings, Options
from smad.experiments.cycle_theory import stiffnesses
from smad.experiments.driver import Driver, Mounting
from smad.experiments.errors import ExperimentError
from smad.experiments.estimate import Estimate, Tolerance, bootstrap, estimates_from
from smad.experiments.recording import Recording
from smad.report.page import Picture, Table, Text
from smad.report.plots import draw, label, new_figure, picture
from smad.style.palette import in_print

USED = (0.05, 0.95)
"""Fractions used in the fits: near 0 and 1 the cosine is flat and noise turns into temperature."""
_STEP_K = 0.05
_TEMPERATURE, _SLOPE = Tolerance(difference=0.5), Tolerance(share=0.1)
_OF_HEATING = {
    "austenite_start": _TEMPERATURE,
    "austenite_finish": _TEMPERATURE,
    "slope_austenite": _SLOPE,
}
_OF_COOLING = {"martensite_start": _TEMPERATURE, "slope_martensite": _SLOPE}


class BlockOptions(Options, frozen=True, kw_only=True):
    """Settings of fig5-block. The stage adds to the deflection at which the spring is mounted."""

    low_stage_mm: Annotated[float, Meta(ge=0.0, le=50.0)] = 0.0
    high_stage_mm: Annotated[float, Meta(ge=0.0, le=50.0)] = 5.0
    top_degC: Annotated[float, Meta(ge=40.0, le=80.0)] = 75.0
    heating_K_per_s: Annotated[float, Meta(gt=0.0, le=5.0)] = 0.3
    bottom_degC: Annotated[float, Meta(ge=28.0, le=60.0)] = 36.0


@dataclass(frozen=True)
class Branch:
    """Temperature in K and stress in Pa along one heating or cooling, in order of time."""

    temperature_K: Array
    stress_Pa: Array


@dataclass(frozen=True)
class Block:
    """One prestress: deflection in m, stress before heating in Pa, and the two branches."""

    deflection_m: float
    rest_stress_Pa: float
    heating: Branch
    cooling: Branch


class Fig5Block(Experiment[BlockOptions]):
    """Block tests at two prestresses."""

    name = "fig5-block"
    title = "Fig. 5: block tests at two prestresses"
    needs = frozenset({"force_N", "rtd_x_degC", "stage"})
    options_type = BlockOptions

    def mountings(self) -> frozenset[Mounting]:
        return frozenset({Mounting("blocked")})

    def trials(self) -> tuple[str, ...]:
        return ("fig5-block/low", "fig5-block/high")

    def plan(self, trial: str) -> Plan:
        """Prestress, heat slowly to the plateau, cool in still water."""
        options = self.options
        stage_mm = options.low_stage_mm if trial.endswith("low") else options.high_stage_mm
        return Plan(
            trial,
            (
                Do(MoveStage(stage_mm=stage_mm, rate_mm_per_s=1.0)),
                UntilDone(stage_mm + 10.0),
                Mark("rest"),
                Pause(3.0),
                Mark("heat"),
                Do(
                    HoldTemperature(
                        spring="x",
                        temperature_degC=options.top_degC,
                        rate_K_per_s=options.heating_K_per_s,
                        duration_s=5.0,
                        use_water=False,
                    )
                ),
                UntilDone(100.0 / options.heating_K_per_s),
                Mark("cool"),
                Do(DriveCurrent(stop_below_degC=options.bottom_degC)),
                UntilDone(3600.0),
                Mark("end"),
            ),
            fixture="blocked",
        )

    def conduct(self, trial: str, driver: Driver) -> Recording:
        return driver.run(self.plan(trial))

    def conclude(self, outcomes: Mapping[str, Any], model: ParameterSet) -> Findings:
        options = self.options
        blocks = [
            block_of(outcomes[trial], model, stage_mm * 1e-3)
            for trial, stage_mm in zip(
                self.trials(), (options.low_stage_mm, options.high_stage_mm), strict=True
            )
        ]
        estimates = [*reverse_lines(blocks, model), *forward_lines(blocks, model)]
        by_name = {estimate.name: estimate.value for estimate in estimates}
        return Findings(
            (
                Comparison(
                    "Fig. 5: C_A, C_M",
                    "slopes of the four lines; values not given (Table 1 is missing)",
                    f"{by_name['slope_austenite'] / 1e6:.2f}, "
                    f"{by_name['slope_martensite'] / 1e6:.2f} MPa/K",
                    "from all samples of the transformation, not from four points a run",
                ),
            ),
            (
                _figure(blocks, estimates, model),
                four_points(blocks, model),
                Text(
                    "The paper reads four temperatures a run off the corners of the curve and "
                    "joins two points by a line. The kinetics are cosines, whose corners are "
                    "round; here the fraction is computed from force and moduli at every sample, "
                    "and Eqs (11) and (13), which are linear in temperature, stress and arccosine "
                    "of the fraction, are fitted to all samples of both runs."
                ),
            ),
            estimates,
        )


_CAPTION = (
    "Stress against temperature between fixed ends. Dashed: lines of A_S and A_F, dotted: of M_S."
)


def block_of(recording: Recording, model: ParameterSet, stage_m: float) -> Block:
    """The two branches of a block test, averaged over steps of 0.05 K so that time does not weigh.

    The deflection is the mounted one (δ0 of `model`) plus the stage.
    """
    c1, _ = spring_factors(model)
    rest = recording.between("rest", "heat")

    def branch(part: Recording) -> Branch:
        temperature = part["rtd_x_degC"] + ZERO_C
        force = part["force_N"]
        good = np.isfinite(temperature) & np.isfinite(force)
        if good.sum() < 100:
            raise ExperimentError(
                "a branch of the block test has too few samples",
                value=int(good.sum()),
                limit="at least 100 with force and temperature",
                action="repeat the run",
            )
        temperature, force = temperature[good], force[good]
        cells = np.floor(temperature / _STEP_K).astype(int)
        _, first, cell = np.unique(cells, return_index=True, return_inverse=True)
        count = np.bincount(cell)
        order = np.argsort(first)
        return Branch(
            (np.bincount(cell, temperature) / count)[order],
            (np.bincount(cell, force) / count)[order] * c1,
        )

    return Block(
        model["initial_deflection"] + stage_m,
        float(np.nanmean(rest["force_N"])) * c1,
        branch(recording.between("heat", "cool")),
        branch(recording.between("cool", "end")),
    )


def fractions(block: Block, model: ParameterSet) -> tuple[Array, Array]:
    """ξ on heating, and ξ = ξ_S on cooling, from stress at a fixed deflection, Eq. (9).

    On heating ξ_S and ξ keep their ratio, and of the deflection at rest δ − F/k_M is detwinned,
    Eq. (10).
    """
    c1, _ = spring_factors(model)
    k_m, k_a = stiffnesses(model)
    at_rest_m = block.deflection_m - block.rest_stress_Pa / c1 / k_m

    def fraction(branch: Branch, reach_m: float) -> Array:
        """The smaller root ξ of F = (k_A − soft·ξ)(δ − reach·ξ); nan where there is none."""
        soft = k_a - k_m
        a, b = soft * reach_m, -(k_a * reach_m + soft * block.deflection_m)
        root = b * b - 4.0 * a * (k_a * block.deflection_m - branch.stress_Pa / c1)
        with np.errstate(invalid="ignore"):
            return (-b - np.sqrt(root)) / (2.0 * a)

    return fraction(block.heating, at_rest_m), fraction(block.cooling, model["max_deflection"])


def _progress(left: Array) -> Array:
    """The a of left = (1 + cos πa)/2."""
    return np.arccos(np.clip(2.0 * left - 1.0, -1.0, 1.0)) / np.pi


def reverse_lines(blocks: Sequence[Block], model: ParameterSet) -> list[Estimate]:
    """A_S, A_F and C_A: T = A_S + (A_F − A_S)·a + τ/C_A, which is Eq. (11) solved for T.

    Linear least squares over both prestresses; intervals by block bootstrap within each run.
    """
    fraction = [fractions(block, model)[0] for block in blocks]
    rows = [_used(b.heating, xi, left=xi) for b, xi in zip(blocks, fraction, strict=True)]
    data, groups = _stacked(rows, "heating")

    def fit(chosen: Index) -> Sequence[float]:
        temperature, progress, stress = data[chosen].T
        start, width, slope = _solve(
            np.column_stack([np.ones_like(progress), progress, stress * 1e-6]), temperature
        )
        return start, start + width, 1e6 / slope

    intervals = bootstrap(fit, len(data), seed=51, groups=groups)
    return estimates_from(_OF_HEATING, intervals, "fig5-block, heating")


def forward_lines(blocks: Sequence[Block], model: ParameterSet) -> list[Estimate]:
    """M_S and C_M: τ = τ_s + (τ_f − τ_s)·b + C_M(T − M_S), which is Eq. (13) solved for τ.

    Above M_S only. The intercept holds τ_s − C_M M_S, so M_S rests on the τ_s of `model`.
    """
    # Eq. (13) holds above M_S only; two kelvin keep clear of it whatever M_S turns out to be.
    above_K = model["martensite_start"] + 2.0
    fraction = [fractions(block, model)[1] for block in blocks]
    rows = [
        _used(b.cooling, xi, left=1.0 - xi, above_K=above_K)
        for b, xi in zip(blocks, fraction, strict=True)
    ]
    data, groups = _stacked(rows, "cooling")
    stress_start = model["stress_start"] * 1e-6
    width = (model["stress_finish"] - model["stress_start"]) * 1e-6

    def fit(chosen: Index) -> Sequence[float]:
        temperature, progress, stress = data[chosen].T
        # The width of the band comes from the stretch (Fig. 4). The noise is in the temperature.
        line = stress * 1e-6 - width * progress
        offset, per_MPa = _solve(np.column_stack([np.ones_like(line), line]), temperature)
        return offset + per_MPa * stress_start, 1e6 / per_MPa

    intervals = bootstrap(fit, len(data), seed=52, groups=groups)
    return estimates_from(_OF_COOLING, intervals, "fig5-block, cooling")


def _used(branch: Branch, xi: Array, *, left: Array, above_K: float = -np.inf) -> Array:
    """Temperature, progress of what is `left`, and stress of the samples to fit, shape (m, 3)."""
    used = (xi > USED[0]) & (xi < USED[1]) & (branch.temperature_K > above_K)
    return np.column_stack([branch.temperature_K, _progress(left), branch.stress_Pa])[used]


def _solve(columns: Array, target: Array) -> Array:
    return np.asarray(np.linalg.lstsq(columns, target, rcond=None)[0], float)


def _stacked(rows: Sequence[Array], branch: str) -> tuple[Array, list[Index]]:
    for block in rows:
        if len(block) < 30:
            raise ExperimentError(
                f"a block test shows too little transformation on {branch}",
                value=f"{len(block)} steps of {_STEP_K} K",
                limit="at least 30",
                action="raise top_degC or the prestress, or check the moduli of the model",
            )
    ends = np.cumsum([0, *(len(block) for block in rows)])
    return np.concatenate(rows), [np.arange(a, b) for a, b in pairwise(ends)]


def four_points(blocks: Sequence[Block], model: ParameterSet) -> Table:
    """The paper's reading: temperature and stress where each transformation starts and ends.

    Start and end are taken at 2 % and 98 % of the change of the fraction.
    """
    rows = []
    for block in blocks:
        cells = [f"{block.deflection_m * 1e3:.0f} mm"]
        heating, cooling = fractions(block, model)
        for xi, branch, marks in (
            (heating, block.heating, (0.98, 0.02)),
            (cooling, block.cooling, (0.02, 0.98)),
        ):
            for mark in marks:
                k = int(np.nanargmin(np.abs(xi - mark)))
                reached = abs(float(xi[k]) - mark) < 0.02
                degC, stress_MPa = branch.temperature_K[k] - ZERO_C, branch.stress_Pa[k] / 1e6
                cells.append(f"{degC:.1f} °C, {stress_MPa:.0f} MPa" if reached else "not reached")
        rows.append(cells)
    return Table(
        ("deflection", "austenite starts", "… is complete", "martensite starts", "… is complete"),
        rows,
        "Temperatures and stresses at 2 % and 98 % of each transformation",
    )


def _figure(blocks: Sequence[Block], estimates: Sequence[Estimate], model: ParameterSet) -> Picture:
    by_name = {estimate.name: estimate.value for estimate in estimates}
    figure, (axes,) = new_figure(height_in=3.6)
    for block, style in zip(blocks, ("-", "--"), strict=True):
        name = f"δ = {block.deflection_m * 1e3:.0f} mm"
        for branch, what, colour in (
            (block.heating, "heating", "x"),
            (block.cooling, "cooling", "main"),
        ):
            draw(
                axes,
                branch.temperature_K - ZERO_C,
                branch.stress_Pa / 1e6,
                f"{name}, {what}",
                colour,
                style=style,
                width=2.0,
            )
    stress = np.array([40e6, 180e6])
    for name in ("austenite_start", "austenite_finish"):
        line = by_name[name] - ZERO_C + stress / by_name["slope_austenite"]
        axes.plot(line, stress / 1e6, "--", color=in_print("text"), linewidth=0.8)
        axes.annotate(name.replace("austenite_", "A, "), (line[1], 180.0), fontsize=7)
    line = (
        by_name["martensite_start"]
        - ZERO_C
        + (stress - model["stress_start"]) / by_name["slope_martensite"]
    )
    axes.plot(line, stress / 1e6, ":", color=in_print("text"), linewidth=0.8)
    axes.annotate("M, start", (line[1], 172.0), fontsize=7)
    axes.set_ylim(0.0, 190.0)
    label(axes, "temperature, °C", "shear stress, MPa")
    return picture(
        figure, "Stress against temperature of blocked springs at two prestresses", _CAPTION
    )
