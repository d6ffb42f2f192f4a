"""The plant, sample by sample: a drive goes in, readings come out, the truth can be looked at."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping, Sequence

import numpy as np

from sim_device.plant import kernel as k
from sim_device.plant.energy import EnergyBook, energy_book
from sim_device.plant.errors import InputError, SolverError
from sim_device.plant.laws import Law
from sim_device.plant.parameters import ParameterSet
from sim_device.plant.records import Drive, PlantTruth, Readings
from sim_device.plant.setup import Setup
from sim_device.plant.units import ZERO_C

MAX_STEP_S = 1e-3
_REASONS = {
    k.NOT_CONVERGED: "the equilibrium of temperature, fractions and force was not found",
    k.NOT_FINITE: "the state is no longer finite",
}
NOISE_OF_READINGS = (
    *("noise_current",) * 2,
    *("noise_voltage",) * 2,
    *("noise_temperature",) * 4,
    "noise_displacement",
    "noise_force",
)
"""Parameter with the noise of each number of SENSED."""
# Where the numbers of the state and of the drive stand in their rows.
SENSED = slice(
    k.place_of(k.State, "shared.sensed.i_x"), k.place_of(k.State, "shared.sensed.force") + 1
)
_DRIVE = slice(k.place_of(k.Work, "drive.i_x"), k.place_of(k.Work, "drive.stage") + 1)
_FORCES = k.place_of(k.Work, "forces")
_CURRENT_X, _CURRENT_Y = k.place_of(k.State, "x.current"), k.place_of(k.State, "y.current")
_HEAT_X, _HEAT_Y = k.place_of(k.State, "x.heat_in"), k.place_of(k.State, "y.heat_in")
_CYCLES = k.place_of(k.State, "x.cycles"), k.place_of(k.State, "y.cycles")
_T_X, _T_Y = k.place_of(k.State, "x.T_wire"), k.place_of(k.State, "y.T_wire")
_XI_X, _XI_Y = (
    tuple(k.place_of(k.State, f"{spring}.memory.{part}") for part in ("xi_S", "xi_T"))
    for spring in "xy"
)
_GIVEN_INLET = k.place_of(k.State, "shared.given_inlet")
_GIVEN_AIR = k.place_of(k.State, "shared.given_air")
_OF_SPRINGS = (
    "T_wire", "T_water", "memory.xi_S", "memory.xi_T", "tension", "deflection", "current",
    "resistance", "flow", "filled",
)  # fmt: skip
_OF_BOTH = ("time", "displacement", "tension", "T_inlet", "T_air")
_TRUTH = [
    *(k.place_of(k.State, f"x.{name}") for name in _OF_SPRINGS),
    *(k.place_of(k.State, f"y.{name}") for name in _OF_SPRINGS),
    *(k.place_of(k.State, f"shared.{name}") for name in _OF_BOTH),
]


class Plant:
    """The springs with their water, sensors and fixture, stepped with fixed inputs.

    parameters: from `load_parameters`. variant: "extended", or "printed" (the paper's constant
    water temperature and rounded properties). fixture: "antagonistic", "stretch" (spring X
    pulled by the stage), "blocked" (spring X held at δ0 + stage). cooling: "water" (in the
    tube), "air" (bare wire) or "bath" (bare wire in water at rest). effects: name to
    parameters, see `sim_device.plant.effects`. laws: what is missing at places of the model,
    see `sim_device.plant.laws`. seed: of the sensor noise. max_step_s: longest substep.
    temperature_K: of wire and water at the start, all martensite; None: `constants.mounting`.
    """

    def __init__(
        self,
        parameters: ParameterSet,
        *,
        variant: str = "extended",
        fixture: str = "antagonistic",
        cooling: str = "water",
        effects: Mapping[str, Mapping[str, float]] | None = None,
        laws: Sequence[Law] = (),
        seed: int = 0,
        max_step_s: float = MAX_STEP_S,
        temperature_K: float | None = None,
    ) -> None:
        self.parameters = parameters
        self.variant = variant
        setup = Setup.make(
            parameters,
            variant=variant,
            fixture=fixture,
            cooling=cooling,
            effects=effects or {},
            laws=laws,
        )
        self.effects = setup.effects
        self._setup = setup
        self._state = setup.state(temperature_K)
        self._start = k.copied(self._state)
        self._row = k.numbers(self._state)
        self._heat_at_start_J = self._heat_J()
        self._ring = setup.ring()
        self._work = k.zeros(k.Work)
        self._memory = setup.memory()
        k.numbers(self._work)[_FORCES] = 1.0 if len(laws) else 0.0
        self.laws = tuple(laws)
        self._drive = k.numbers(self._work)[_DRIVE]
        self._last: Drive | None = None
        self._max_step_s = max_step_s
        self._rng = np.random.default_rng(seed)
        self._sigma = np.array([parameters[name] for name in NOISE_OF_READINGS])
        self._supply_V = parameters["supply_voltage"]
        self._supply_Ohm = parameters["supply_resistance"]

    def advance(self, drive: Drive, dt_s: float) -> None:
        """Hold `drive` for `dt_s`, in substeps of at most `max_step_s`.

        Raises InputError for a drive that is not physical (a value that is not finite, a duty
        outside 0 to 1, a negative current) and SolverError, with time and state, if the kernel
        finds no solution.
        """
        if drive is not self._last:
            _fill(self._drive, drive)
            self._last = drive
        if not 0.0 < dt_s < math.inf:
            raise InputError(f"dt_s = {dt_s} s; a sample needs a positive finite duration")
        steps = max(1, math.ceil(dt_s / self._max_step_s - 1e-9))
        setup = self._setup
        status = k.advance(
            self._state,
            self._work,
            setup.model,
            self._ring,
            setup.table,
            setup.laws,
            self._memory,
            dt_s / steps,
            steps,
        )
        if status != k.OK:
            raise solver_error(status, self._row)

    @property
    def cycles(self) -> tuple[float, float]:
        """Transformation cycles that each spring has behind it."""
        return float(self._row[_CYCLES[0]]), float(self._row[_CYCLES[1]])

    @cycles.setter
    def cycles(self, behind: tuple[float, float]) -> None:
        """Age the springs: effects that grow with cycles are as after so many."""
        self._row[list(_CYCLES)] = behind

    def read(self) -> Readings:
        """What the sensors say now. Every call draws new noise from the seed."""
        seen = self._row[SENSED].tolist()
        noise = (self._rng.standard_normal(len(NOISE_OF_READINGS)) * self._sigma).tolist()
        i_x, i_y, v_x, v_y, t_x, t_y, t_in, t_air, u, force = map(operator.add, seen, noise)
        drawn = self._row[_CURRENT_X] + self._row[_CURRENT_Y]
        return Readings(
            i_A=(i_x, i_y),
            v_V=(v_x, v_y),
            rtd_degC=(t_x - ZERO_C, t_y - ZERO_C, t_in - ZERO_C, t_air - ZERO_C),
            displacement_m=u,
            force_N=force,
            supply_V=self._supply_V - self._supply_Ohm * float(drawn),
        )

    def set_environment(
        self, *, inlet_K: float | None = None, ambient_K: float | None = None
    ) -> None:
        """Change the temperature of the water at the inlet or of the air, from now on."""
        for place, value in ((_GIVEN_INLET, inlet_K), (_GIVEN_AIR, ambient_K)):
            if value is not None:
                if not math.isfinite(value):
                    raise InputError(f"temperature {value} K is not finite")
                self._row[place] = value

    @property
    def truth(self) -> PlantTruth:
        """The state behind the readings."""
        return truth_of(self._row)

    @property
    def xi(self) -> tuple[float, float]:
        """Martensite fraction of each spring, as `truth.xi`; for every sample."""
        row = self._row
        return float(row[_XI_X[0]] + row[_XI_X[1]]), float(row[_XI_Y[0]] + row[_XI_Y[1]])

    @property
    def T_K(self) -> tuple[float, float]:
        """Temperature of each wire, K, as `truth.T_K`; for every sample."""
        return float(self._row[_T_X]), float(self._row[_T_Y])

    @property
    def numbers(self) -> np.ndarray:
        """The numbers of the kernel's state, to read at `kernel.place_of`; not for writing."""
        seen = self._row.view()
        seen.flags.writeable = False
        return seen

    @property
    def energy(self) -> EnergyBook:
        """The energy books since the start."""
        return energy_book(self._start[0], self._state[0], self._setup)

    @property
    def heat_in_J(self) -> float:
        """Electrical heat of both springs since the start, as in the books; for every sample."""
        return self._heat_J() - self._heat_at_start_J

    def _heat_J(self) -> float:
        return float(self._row[_HEAT_X] + self._row[_HEAT_Y])


def truth_of(row: np.ndarray) -> PlantTruth:
    """The record of the numbers of one state of the kernel."""
    v = row[_TRUTH].tolist()
    pairs = list(zip(v[: len(_OF_SPRINGS)], v[len(_OF_SPRINGS) :], strict=False))
    T, T_water, xi_S, xi_T, tension, deflection, current, resistance, flow, filled = pairs
    time, displacement, force, inlet, air = v[2 * len(_OF_SPRINGS) :]
    return PlantTruth(
        t_s=time,
        T_K=T,
        T_water_K=T_water,
        xi=(xi_S[0] + xi_T[0], xi_S[1] + xi_T[1]),
        xi_S=xi_S,
        xi_T=xi_T,
        spring_force_N=tension,
        deflection_m=deflection,
        displacement_m=displacement,
        force_N=force,
        i_A=current,
        resistance_Ohm=resistance,
        flow_m3_s=flow,
        fill=filled,
        inlet_K=inlet,
        ambient_K=air,
    )


def solver_error(status: int, row: np.ndarray) -> SolverError:
    """The error for a status that the kernel returned, with the state it returned it at."""
    truth = truth_of(row)
    return SolverError(
        _REASONS[status],
        time_s=truth.t_s,
        state={
            "T_x_K": truth.T_K[0],
            "T_y_K": truth.T_K[1],
            "xi_x": truth.xi[0],
            "xi_y": truth.xi[1],
            "force_N": truth.force_N,
            "displacement_m": truth.displacement_m,
        },
    )


def _fill(row: np.ndarray, drive: Drive) -> None:
    i_x, i_y = drive.i_A
    duty_x, duty_y = drive.pump_duty
    if not (0.0 <= i_x < math.inf and 0.0 <= i_y < math.inf):
        raise InputError(f"currents {drive.i_A} A; each must be finite and not negative")
    if not (0.0 <= duty_x <= 1.0 and 0.0 <= duty_y <= 1.0):
        raise InputError(f"pump duties {drive.pump_duty}; each must lie in 0 to 1")
    if not -1.0 < drive.stage_m < 1.0:
        raise InputError(f"stage_m = {drive.stage_m} m; the stage travels less than 1 m")
    row[0] = i_x
    row[1] = i_y
    row[2] = duty_x
    row[3] = duty_y
    row[4] = drive.drain[0]
    row[5] = drive.drain[1]
    row[6] = drive.stage_m
