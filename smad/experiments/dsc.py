"""Fig. 2: transformation temperatures, heat capacity and latent heats from a calorimeter's file."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from sim_device.plant.parameters import ParameterSet
from sim_device.plant.units import ZERO_C
from smad.arrays import Array, Mask
from smad.experiments.base import Comparison, Experiment, Findings, Options
from smad.experiments.driver import Driver, Mounting
from smad.experiments.dsc_file import DscData, read_dsc, synthetic_dsc
from smad.experiments.errors import DataFileError
from smad.experiments.estimate import Estimate, Tolerance, estimates_from
from smad.report.page import Picture, Table, Text
from smad.report.plots import draw, label, new_figure, picture
from smad.style.palette import in_print

WINDOW_K = 0.8
"""Width of the straight lines by which slopes are taken."""
TURN_K = 3.0
REPEATS = 100


class DscOptions(Options, frozen=True, kw_only=True):
    """Settings of dsc. Without a file a synthetic one is made from the model, to try the method."""

    file: Annotated[str, Meta(description="CSV of the calorimeter; empty: synthetic")] = ""
    seed: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 0
    first_guess_degC: Annotated[float, Meta(ge=0.0, le=120.0)] = 60.0
    """A temperature above both peaks, from which the baselines are drawn."""


class Dsc(Experiment[DscOptions]):
    """Analysis of a differential scanning calorimetry."""

    name = "dsc"
    title = "Fig. 2: differential scanning calorimetry"
    needs = frozenset()
    options_type = DscOptions

    def mountings(self) -> frozenset[Mounting]:
        return frozenset()

    def conduct(self, trial: str, driver: Driver) -> DscData | None:
        """Read the file; nothing moves on the bench. None asks for a synthetic one."""
        return read_dsc(Path(self.options.file)) if self.options.file else None

    def conclude(self, outcomes: Mapping[str, Any], model: ParameterSet) -> Findings:
        data: DscData = outcomes[self.name] or synthetic_dsc(model, seed=self.options.seed)
        guess_K = self.options.first_guess_degC + ZERO_C
        found = quantities(data, guess_K)
        estimates = estimates_of(data, guess_K, seed=self.options.seed)
        synthetic = not self.options.file
        return Findings(
            (
                Comparison(
                    "Fig. 2: A_S, A_F, M_S, M_F",
                    "values not given (Table 1 is missing)",
                    ", ".join(f"{found[name] - ZERO_C:.1f}" for name in _TEMPERATURES) + " °C",
                    "from a synthetic file of the model" if synthetic else self.options.file,
                ),
                Comparison(
                    "Fig. 2: latent heats; C_s, Eq. (28)",
                    "12 188 and 4 138 J/kg; 466 and 260 J/kgK (sister paper)",
                    f"{found['latent_heating']:.0f} and {found['latent_cooling']:.0f} J/kg; "
                    f"{found['heat_capacity_heating']:.0f} and "
                    f"{found['heat_capacity_cooling']:.0f} J/kgK",
                    contradiction="energy",
                ),
            ),
            (
                _figure(data, found),
                _table(estimates),
                Text(
                    "The intervals hold noise and the choices of the evaluation, not the "
                    "smoothing by the instrument: on synthetic files that moved a temperature by "
                    "up to 0.1 K, which is more than the intervals are wide.",
                    "note",
                ),
                Text(
                    "Heat capacity is taken beside the peak. Fig. 6 of the paper plots it with the "
                    "peak inside; a model that uses that curve and the latent heat as well counts "
                    "the latent heat twice.",
                    "note",
                ),
            ),
            estimates,
        )


_CAPTION = "Heat flow into the sample, endothermic up. Vertical lines: the tangent method."


def quantities(data: DscData, above_K: float, window_K: float = WINDOW_K) -> dict[str, float]:
    """What the peaks of heating and cooling give, by parameter, in SI.

    Capacities are nan without an empty-pan baseline in the file. `window_K` is the length of a
    tangent. Raises DataFileError without a peak.
    """
    rate = np.gradient(data.temperature_K, data.t_s)
    lag_s = instrument_lag(data)
    found: dict[str, float] = {}
    for names, half, sign in (
        (_OF_HEATING, rate > 0.5 * data.rate_K_per_s, 1.0),
        (_OF_COOLING, rate < -0.5 * data.rate_K_per_s, -1.0),
    ):
        peak = _peak(data, half, above_K, sign=sign, lag_s=lag_s, window_K=window_K)
        found |= dict(zip(names, peak, strict=True))
    return found


def instrument_lag(data: DscData) -> float:
    """Time constant of the instrument in s, from the transient where heating turns into cooling.

    There the heat flow of the sample jumps and the signal follows with the lag: the area between
    the signal and its new level is the jump times the lag. At a constant rate the lag shifts the
    whole curve along the temperature, and is taken out so. 0 when there is no such place.
    """
    turn = int(np.argmax(data.temperature_K))
    span = round(60.0 / max(1e-9, float(np.median(np.diff(data.t_s)))))
    if turn < span or turn + 2 * span > data.t_s.size:
        return 0.0
    before = float(np.mean(data.heat_flow_W[turn - span : turn - 1]))
    level = float(np.mean(data.heat_flow_W[turn + span : turn + 2 * span]))
    after = slice(turn, turn + span)
    area = float(np.trapezoid(data.heat_flow_W[after] - level, data.t_s[after]))
    return max(0.0, area / (before - level)) if before != level else 0.0


def _peak(
    data: DscData, half: Mask, above_K: float, *, sign: float, lag_s: float, window_K: float
) -> tuple[float, float, float, float]:
    """Where a peak's flanks' tangents meet the baseline (K), its area in J/kg, and C in J/kgK."""
    order = np.argsort(data.temperature_K[half])
    temperature = data.temperature_K[half][order] - sign * lag_s * data.rate_K_per_s
    flow = sign * data.heat_flow_W[half][order]
    if temperature.size < 100:
        raise DataFileError(
            "the file holds no " + ("heating" if sign > 0 else "cooling"),
            value=f"{temperature.size} samples",
            limit="at least 100",
            action="record heating and cooling at a constant rate",
        )
    # Above the peak there is room for a straight baseline; below it often only a kelvin or two.
    # Its last kelvins hold the transient of the turn.
    far = (temperature > above_K - 5.0) & (temperature < temperature[-1] - TURN_K)
    base = np.polyval(np.polyfit(temperature[far], flow[far], 1), temperature)
    excess = flow - base
    noise = float(np.std(excess[far])) + 1e-12
    top = int(np.argmax(_smooth(excess, temperature, window_K)))
    if excess[top] < 10.0 * noise:
        raise DataFileError(
            "no peak stands out from the baseline",
            value=f"{excess[top] * 1e3:.3g} mW",
            limit=f"{10e3 * noise:.3g} mW",
            action="check the file's columns and units",
        )
    low_K = _tangent(temperature, excess, temperature[top], window_K, rising=True)
    high_K = _tangent(temperature, excess, temperature[top], window_K, rising=False)
    inside = (temperature > low_K - WINDOW_K) & (temperature < high_K + WINDOW_K)
    area = float(np.trapezoid(excess[inside], temperature[inside])) / data.rate_K_per_s
    capacity = float("nan")
    if data.baseline_W is not None:
        empty = sign * data.baseline_W[half][order]
        capacity = float(np.mean((flow - empty)[far])) / (data.rate_K_per_s * data.mass_kg)
    return low_K, high_K, area / data.mass_kg, capacity


def _smooth(values: Array, temperature: Array, window_K: float) -> Array:
    width = _window(temperature, window_K)
    return np.convolve(values, np.ones(width) / width, "same")


def _window(temperature: Array, window_K: float) -> int:
    """Number of samples in `window_K`."""
    return max(3, round(window_K / max(1e-9, float(np.median(np.diff(temperature))))))


def _tangent(
    temperature: Array, excess: Array, top_K: float, window_K: float, *, rising: bool
) -> float:
    """Where the tangent at the steepest place of a flank meets the baseline (zero excess).

    The tangent is the straight line through `window_K` of the flank with the largest slope, at
    samples that are evenly spaced in temperature. Only the flank next to the top counts: from the
    top down to a tenth of its height.
    """
    width = _window(temperature, window_K)
    x = np.arange(width) - 0.5 * (width - 1)
    step_K = float(np.median(np.diff(temperature)))
    slope = np.correlate(excess, x, "valid") / (np.sum(x * x) * step_K)
    level = np.correlate(excess, np.full(width, 1.0 / width), "valid")
    middle = np.correlate(temperature, np.full(width, 1.0 / width), "valid")
    top = int(np.argmin(np.abs(middle - top_K)))
    low = np.flatnonzero(level < 0.1 * level[top])
    foot = low[low < top].max(initial=0) if rising else low[low > top].min(initial=level.size - 1)
    flank = slice(foot, top + 1) if rising else slice(top, foot + 1)
    steepest = int(np.argmax(slope[flank] if rising else -slope[flank])) + flank.start
    return float(middle[steepest] - level[steepest] / slope[steepest])


def estimates_of(data: DscData, above_K: float, seed: int) -> list[Estimate]:
    """All parameters of a calorimetry, with intervals from resampled noise and choices.

    The noise is that of the signal against its smoothed self; blocks of it are drawn anew, added to
    the smoothed signal, and everything is evaluated again. What the evaluation has to choose, the
    length of the tangents and the start of the baseline, is drawn as well: on a calorimetry that
    choice weighs more than the noise.
    """
    from scipy.ndimage import uniform_filter1d

    smooth: Array = uniform_filter1d(data.heat_flow_W, 5, mode="nearest")
    noise = data.heat_flow_W - smooth
    rng = np.random.default_rng(seed)
    resampled = []
    for _ in range(REPEATS):
        starts = rng.integers(0, noise.size - 50, size=noise.size // 50 + 1)
        drawn = np.concatenate([noise[s : s + 50] for s in starts])[: noise.size]
        window_K = WINDOW_K * rng.uniform(0.6, 1.6)
        start_K = above_K + rng.uniform(-10.0, 10.0)
        found = quantities(replace(data, heat_flow_W=smooth + drawn), start_K, window_K)
        resampled.append([found[name] for name in _QUANTITIES])
    found = quantities(data, above_K)
    value = np.array([found[name] for name in _QUANTITIES])
    spread = np.percentile(np.array(resampled), [2.5, 97.5], axis=0)
    low, high = np.minimum(spread[0], value), np.maximum(spread[1], value)
    return [
        e for e in estimates_from(_QUANTITIES, (value, low, high), "dsc") if np.isfinite(e.value)
    ]


_OF_HEATING = ("austenite_start", "austenite_finish", "latent_heating", "heat_capacity_heating")
_OF_COOLING = ("martensite_finish", "martensite_start", "latent_cooling", "heat_capacity_cooling")
_TEMPERATURES = {
    "austenite_start": "A_S",
    "austenite_finish": "A_F",
    "martensite_start": "M_S",
    "martensite_finish": "M_F",
}
_HEATS = ("latent_heating", "latent_cooling", "heat_capacity_heating", "heat_capacity_cooling")
_QUANTITIES: Mapping[str, Tolerance] = {
    **dict.fromkeys(_TEMPERATURES, Tolerance(difference=0.5)),
    **dict.fromkeys(_HEATS, Tolerance(share=0.05)),
}


def _table(estimates: Sequence[Estimate]) -> Table:
    def shown(estimate: Estimate, value: float) -> str:
        if estimate.tolerance.difference:
            return f"{value - ZERO_C:.2f} °C"
        return f"{value:.0f} {'J/kg' if estimate.name.startswith('latent') else 'J/(kg K)'}"

    return Table(
        ("parameter", "value", "95 % interval"),
        [
            (
                estimate.name,
                shown(estimate, estimate.value),
                f"{shown(estimate, estimate.low)} to {shown(estimate, estimate.high)}",
            )
            for estimate in estimates
        ],
        numeric=frozenset({1, 2}),
    )


def _figure(data: DscData, found: Mapping[str, float]) -> Picture:
    figure, (axes,) = new_figure(height_in=3.0)
    rate = np.gradient(data.temperature_K, data.t_s)
    for half, name, colour in ((rate > 0, "heating", "x"), (rate < 0, "cooling", "main")):
        draw(axes, data.temperature_K[half] - ZERO_C, data.heat_flow_W[half] * 1e3, name, colour)
    for name, symbol in _TEMPERATURES.items():
        degC = found[name] - ZERO_C
        axes.axvline(degC, color=in_print("reference"), linewidth=0.7)
        axes.annotate(symbol, (degC, 0.98), xycoords=("data", "axes fraction"), fontsize=8)
    label(axes, "temperature, °C", "heat flow, mW")
    return picture(figure, "Heat flow of a calorimetry on heating and cooling", _CAPTION)
