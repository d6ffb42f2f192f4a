"""Replay: recorded inputs through the plant in one kernel call, whole or one sub-model alone."""

from __future__ import annotations

import copy
import functools
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from sim_device.plant import kernel as k
from sim_device.plant.effects.registry import EffectValues
from sim_device.plant.errors import InputError
from sim_device.plant.laws import Law
from sim_device.plant.parameters import ParameterSet
from sim_device.plant.places import PLACES, SLOTS, Key, check_place_needs, keys_of
from sim_device.plant.plant import solver_error
from sim_device.plant.setup import Setup
from sim_device.plant.start import AS_MOUNTED, Start
from sim_device.plant.units import ZERO_C

Array = npt.NDArray[np.float64]
_LARGEST = sys.float_info.max
DEFAULT_STEP_S = 1e-3
_NO_VALUES: Mapping[str, Array] = {}
_NO_EFFECTS: EffectValues = {}
_NO_FORCING: Mapping[Key, npt.ArrayLike] = {}

# Output name -> number of the kernel's `State` and what is taken off it.
OUTPUTS: dict[str, tuple[str, float]] = {
    "i_x_A": ("shared.sensed.i_x", 0.0),
    "i_y_A": ("shared.sensed.i_y", 0.0),
    "v_x_V": ("shared.sensed.v_x", 0.0),
    "v_y_V": ("shared.sensed.v_y", 0.0),
    "rtd_x_degC": ("shared.sensed.rtd_x", ZERO_C),
    "rtd_y_degC": ("shared.sensed.rtd_y", ZERO_C),
    "rtd_inlet_degC": ("shared.sensed.rtd_inlet", ZERO_C),
    "rtd_ambient_degC": ("shared.sensed.rtd_air", ZERO_C),
    "displacement_m": ("shared.sensed.displacement", 0.0),
    "force_N": ("shared.sensed.force", 0.0),
    "true_displacement_m": ("shared.displacement", 0.0),
    "true_force_N": ("shared.tension", 0.0),
    "kinetics_evaluations": ("shared.rounds", 0.0),
}
for _side in ("x", "y"):
    OUTPUTS |= {
        f"true_i_{_side}_A": (f"{_side}.current", 0.0),
        f"resistance_{_side}_Ohm": (f"{_side}.resistance", 0.0),
        f"T_{_side}_K": (f"{_side}.T_wire", 0.0),
        f"T_water_{_side}_K": (f"{_side}.T_water", 0.0),
        f"xi_S_{_side}": (f"{_side}.memory.xi_S", 0.0),
        f"xi_T_{_side}": (f"{_side}.memory.xi_T", 0.0),
        f"spring_force_{_side}_N": (f"{_side}.tension", 0.0),
        f"deflection_{_side}_m": (f"{_side}.deflection", 0.0),
        f"flow_{_side}_m3_s": (f"{_side}.flow", 0.0),
        f"fill_{_side}": (f"{_side}.filled", 0.0),
        f"heat_in_{_side}_J": (f"{_side}.heat_in", 0.0),
        f"heat_to_water_{_side}_J": (f"{_side}.heat_to_water", 0.0),
        f"heat_to_air_{_side}_J": (f"{_side}.heat_to_air", 0.0),
        f"work_on_{_side}_J": (f"{_side}.work_on", 0.0),
    }
# State of a trajectory, as `laws.own_states` knows it -> numbers of the kernel's `State` whose sum
# it is. What a channel reads is that before anything is forced there.
TRAJECTORY: dict[str, tuple[str, ...]] = {
    "displacement": ("shared.displacement", "shared.added.displacement"),
    "velocity": ("shared.speed", "shared.added_rate.displacement"),
    "time": ("shared.time",),
}
_SENSED = {
    "reading_current": "i_{}", "reading_voltage": "v_{}", "reading_rtd": "rtd_{}",
    "reading_inlet": "rtd_inlet", "reading_ambient": "rtd_air",
    "reading_displacement": "displacement", "reading_force": "force",
}  # fmt: skip
for _side in ("x", "y"):
    TRAJECTORY |= {
        f"wire.{_side}": (f"{_side}.T_wire", f"shared.added.rtd_{_side}"),
        f"water.{_side}": (f"{_side}.T_water",),
        f"current.{_side}": (f"{_side}.current",),
        f"duty.{_side}": (f"{_side}.duty",),
        f"fraction.{_side}": (f"{_side}.memory.xi_S", f"{_side}.memory.xi_T"),
        f"force.{_side}": (f"{_side}.tension", "shared.added.force"),
        f"wire_rate.{_side}": (f"{_side}.T_wire_rate", f"shared.added_rate.rtd_{_side}"),
        f"fraction_rate.{_side}": (f"{_side}.fraction_rate",),
        f"transformed.{_side}": (f"{_side}.cycles",),
    }
for _entry in PLACES:
    if _entry.reading:
        for _side in _entry.sides:
            _channel = _SENSED[_entry.name].format(_side)
            TRAJECTORY[f"{_entry.name}.{_side}"] = (f"shared.raw.{_channel}",)
            TRAJECTORY[f"{_entry.name}_rate.{_side}"] = (f"shared.raw_rate.{_channel}",)

Forcing = Mapping[Key, npt.ArrayLike]
FEEDS: dict[str, int] = {
    "i_A": 2, "temperature_K": 2, "force_N": 1, "displacement_m": 1, "surroundings_K": 2,
}  # fmt: skip
_FEED_COLUMNS = sum(FEEDS.values())


@dataclass(frozen=True)
class Inputs:
    """Recorded inputs, n samples; times need not be even. Springs in the order (X, Y).

    t_s (n,), increasing. i_A (n, 2): currents that the driver was given. pump_duty (n, 2), 0 to 1.
    drain (n, 2), 0 or 1. stage_m (n,). inlet_K, ambient_K (n,), or one for all: temperatures of
    water and air; left out, the parameter set's. start: of an antagonistic pair, cut to what its
    springs can stand at. Row k is in force over the interval that ends at t_s[k], as a board
    reports what it applies together with what it measures.
    """

    t_s: Array
    i_A: Array
    pump_duty: Array
    drain: Array | None = None
    stage_m: Array | None = None
    inlet_K: Array | float | None = None
    ambient_K: Array | float | None = None
    start: Start = AS_MOUNTED
    rows: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        n = len(self.t_s)
        if n < 1:
            raise InputError("t_s is empty; a replay needs at least one sample")
        time = _checked("t_s", self.t_s, (n,))
        backward = np.flatnonzero(np.diff(time) <= 0.0)
        if backward.size:
            row = int(backward[0])
            raise InputError(
                f"t_s does not increase at sample {row + 1}: {time[row + 1]} s after {time[row]} s"
            )
        rows = np.zeros((n, 7))
        rows[:, 0:2] = _checked("i_A", self.i_A, (n, 2), 0.0, math.inf)
        rows[:, 2:4] = _checked("pump_duty", self.pump_duty, (n, 2), 0.0, 1.0)
        if self.drain is not None:
            rows[:, 4:6] = _checked("drain", self.drain, (n, 2), 0.0, 1.0)
        if self.stage_m is not None:
            rows[:, 6] = _checked("stage_m", self.stage_m, (n,), -1.0, 1.0)
        object.__setattr__(self, "t_s", time)
        object.__setattr__(self, "rows", rows)

    def surrounded(
        self,
        inlet_K: Array | float,
        ambient_K: Array | float,
        times_i_y: float = 1.0,
        start: Start = AS_MOUNTED,
    ) -> Inputs:
        """The same, already checked, with other temperatures of water and air, Y's current scaled
        by `times_i_y`, which is positive, and another start."""
        other = copy.copy(self)
        object.__setattr__(other, "inlet_K", inlet_K)
        object.__setattr__(other, "ambient_K", ambient_K)
        object.__setattr__(other, "start", start)
        if times_i_y != 1.0:
            rows = self.rows.copy()
            rows[:, 1] *= times_i_y
            object.__setattr__(other, "rows", rows)
        return other

    def environment(self, parameters: ParameterSet) -> Array:
        """Inlet and ambient temperature of each sample, shape (n, 2), K."""
        n = self.t_s.size
        env = np.empty((n, 2))
        for column, (name, series) in enumerate(
            (("water_temperature", self.inlet_K), ("ambient_temperature", self.ambient_K))
        ):
            if series is None:
                env[:, column] = parameters[name]
            else:
                shape = (n,) if np.ndim(series) else (1,)
                env[:, column] = _checked(name, series, shape, 200.0, 400.0)
        return env


def _checked(
    name: str,
    values: npt.ArrayLike,
    shape: tuple[int, ...],
    low: float = -math.inf,
    high: float = math.inf,
) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.shape != shape:
        raise InputError(f"{name} has shape {array.shape}, it should be {shape}")
    lowest, highest = float(array.min()), float(array.max())
    # Neither comparison holds for NaN.
    if max(low, -_LARGEST) <= lowest and highest <= min(high, _LARGEST):
        return array
    wrong = np.flatnonzero(~(np.isfinite(array) & (array >= low) & (array <= high)).ravel())
    if wrong.size:
        first = int(wrong[0])
        value = array.ravel()[first]
        sample = first // (array.size // shape[0])
        raise InputError(f"{name} = {value} at sample {sample}; it must lie in {low} to {high}")
    return array


def simulate(
    parameters: ParameterSet,
    inputs: Inputs,
    *,
    variant: str = "extended",
    fixture: str = "antagonistic",
    cooling: str = "water",
    effects: EffectValues = _NO_EFFECTS,
    feeds: Mapping[str, Array] = _NO_VALUES,
    forcing: Forcing = _NO_FORCING,
    laws: Sequence[Law] = (),
    dt_s: float = DEFAULT_STEP_S,
    temperature_K: float | None = None,
    outputs: Sequence[str] = tuple(OUTPUTS),
) -> dict[str, Array]:
    """Replay `inputs` and return the named `outputs` (see OUTPUTS), one array (n,) each, no noise.

    dt_s: longest substep. temperature_K: of wire and water at the start; by default that of the
    inlet at the first sample (bare wire: of the air).
    feeds: measured series in place of inner signals, so that a sub-model runs alone. "i_A" (n, 2)
    replaces what the driver makes of the command, "temperature_K" (n, 2) the heat balance,
    "force_N" (n,) the stress that the kinetics see, "displacement_m" (n,) the equilibrium of the
    pair: the force then follows from Eq. (9); "surroundings_K" (n, 2) inlet and ambient as they
    were, held over each sample, while the outputs of those RTDs stay the plant's own. The others
    are interpolated linearly between samples; smooth noisy temperatures first, since noise ratchets
    a hysteresis.
    forcing: what is added at places of the model, see `places`: one series (n,) for each (place,
    side), row k in force over the interval that ends at t_s[k]; at a reading it is given to the
    sensor at t_s[k]. What comes before a feed is replaced by it, the forcing included. laws: the
    same, made by the plant from its own states, see `laws`.
    Without feeds the result is that of `Plant` driven sample by sample, to the last bit.
    Raises InputError, EffectError, ModelError, and SolverError with time and state.
    """
    return Replay(
        inputs,
        variant=variant,
        fixture=fixture,
        cooling=cooling,
        feeds=feeds,
        forcing=forcing,
        outputs=outputs,
    ).run(parameters, effects, laws, dt_s=dt_s, temperature_K=temperature_K)


DRIVEN: tuple[str, ...] = ("i_x_A", "i_y_A", "true_i_x_A", "true_i_y_A")


def drivers(inputs: Inputs, setup: Setup, *, dt_s: float = DEFAULT_STEP_S) -> dict[str, Array]:
    """The currents of a replay, DRIVEN, without the rest of the plant, on which they do not depend.

    The same bits as those outputs of `Replay.run_setup` in the same steps.
    """
    out = np.empty((inputs.t_s.size, len(DRIVEN)))
    state = setup.state(setup.parameters["water_temperature"])
    k.replay_drivers(state, setup.model, inputs.rows, inputs.t_s, dt_s, out)
    return dict(zip(DRIVEN, np.ascontiguousarray(out.T), strict=True))


class Replay:
    """Checked inputs and feeds, ready to be run with many parameter sets and effects."""

    def __init__(
        self,
        inputs: Inputs,
        *,
        variant: str = "extended",
        fixture: str = "antagonistic",
        cooling: str = "water",
        feeds: Mapping[str, Array] = _NO_VALUES,
        forcing: Forcing = _NO_FORCING,
        outputs: Sequence[str] = tuple(OUTPUTS),
    ) -> None:
        self.inputs = inputs
        self._options = {"variant": variant, "fixture": fixture, "cooling": cooling}
        self._flags, self._rows = _feed_rows(feeds, inputs.t_s.size)
        for name, _ in forcing:
            check_place_needs(name, self._options)
        self._forcing = forcing_rows(forcing, inputs.t_s.size)
        unknown = [name for name in outputs if name not in OUTPUTS]
        if unknown:
            raise InputError(f"output {unknown[0]!r} is unknown; known are {', '.join(OUTPUTS)}")
        self._outputs = tuple(outputs)
        self._places = _places_of(tuple(OUTPUTS[name][0] for name in outputs))

    def run(
        self,
        parameters: ParameterSet,
        effects: EffectValues = _NO_EFFECTS,
        laws: Sequence[Law] = (),
        *,
        dt_s: float = DEFAULT_STEP_S,
        temperature_K: float | None = None,
    ) -> dict[str, Array]:
        """One replay; arguments and result as of `simulate`. Safe to call from several threads."""
        return self.run_setup(
            self.setup(parameters, effects, laws), dt_s=dt_s, temperature_K=temperature_K
        )

    def setup(
        self,
        parameters: ParameterSet,
        effects: EffectValues = _NO_EFFECTS,
        laws: Sequence[Law] = (),
    ) -> Setup:
        """What the kernel needs of parameters, effects and laws; serves all replays alike.

        Raises EffectError, ModelError and InputError.
        """
        return Setup.make(parameters, effects=effects, laws=laws, **self._options)

    def run_setup(
        self, setup: Setup, *, dt_s: float = DEFAULT_STEP_S, temperature_K: float | None = None
    ) -> dict[str, Array]:
        """As `run`, with a setup that has been made already."""
        columns = self._columns(setup, dt_s, temperature_K)
        return {
            name: column - OUTPUTS[name][1] if OUTPUTS[name][1] else column
            for name, column in zip(self._outputs, columns, strict=True)
        }

    def _columns(self, setup: Setup, dt_s: float, temperature_K: float | None) -> Array:
        """The numbers of the state at `_places`, a row each."""
        if not 0.0 < dt_s < math.inf:
            raise InputError(f"dt_s = {dt_s} s; a substep must be positive and finite")
        env = self.inputs.environment(setup.parameters)
        if temperature_K is None:
            temperature_K = float(env[0, 1 if setup.cooling == "air" else 0])
        state = setup.state(temperature_K, self.inputs.start)
        row = k.numbers(state)
        out = np.empty((self._places.size, self.inputs.t_s.size))
        status = k.replay(
            state,
            k.zeros(k.Work),
            setup.model,
            setup.ring(),
            setup.table,
            self._flags,
            self._rows,
            self.inputs.rows,
            env,
            self._forcing,
            setup.laws,
            setup.memory(),
            self.inputs.t_s,
            dt_s,
            row,
            self._places,
            out,
        )
        if status != k.OK:
            raise solver_error(status, row)
        return out


@functools.cache
def _places_of(paths: tuple[str, ...]) -> Array:
    """Where numbers like "x.T_wire" stand in the state, as the kernel takes it. Not to be changed:
    all replays with the same outputs share it."""
    return np.array([k.place_of(k.State, path) for path in paths], dtype=np.float64)


def trajectory(replay: Replay, setup: Setup, *, dt_s: float = DEFAULT_STEP_S) -> dict[str, Array]:
    """All states that a law may depend on, (n,) each, by the names of TRAJECTORY.

    `replay` is made with the inputs (feeds, forcing); what it puts out does not matter.
    """
    whole = copy.copy(replay)
    paths = tuple(dict.fromkeys(path for parts in TRAJECTORY.values() for path in parts))
    n = replay.inputs.t_s.size
    # Only under a forcing are readings kept as they were before it.
    forcing = replay._forcing if len(replay._forcing) else np.zeros((n, k.FORCED_SLOTS))
    whole._forcing = forcing
    whole._places = _places_of(paths)
    columns = dict(zip(paths, whole._columns(setup, dt_s, None), strict=True))
    return {
        name: np.asarray(sum(columns[path] for path in parts)) for name, parts in TRAJECTORY.items()
    }


def forcing_rows(forcing: Forcing, n: int) -> Array:
    """Forcing as the kernel takes it, (n, FORCED_SLOTS), or no row. Raises InputError."""
    rows = np.zeros((n if forcing else 0, k.FORCED_SLOTS))
    for (name, side), series in forcing.items():
        values = _checked(f"forcing of {name}.{side}", series, (n,))
        for key in keys_of(name, side):
            rows[:, SLOTS[key]] += values
    return rows if rows.any() else rows[:0]


def _feed_rows(feeds: Mapping[str, Array], n: int) -> tuple[Array, Array]:
    unknown = [name for name in feeds if name not in FEEDS]
    if unknown:
        raise InputError(f"feed {unknown[0]!r} is unknown; known are {', '.join(FEEDS)}")
    flags = np.zeros(len(FEEDS))
    rows = np.zeros((n if feeds else 0, _FEED_COLUMNS))
    column = 0
    for index, (name, width) in enumerate(FEEDS.items()):
        if name in feeds:
            shape = (n, 2) if width == 2 else (n,)
            flags[index] = 1.0
            rows[:, column : column + width] = _checked(name, feeds[name], shape).reshape(n, width)
        column += width
    return flags, rows
