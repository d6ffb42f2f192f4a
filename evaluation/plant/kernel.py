"""The plant in time: a state, one tick of it, and a whole run of ticks."""

# Compiled functions take arrays one by one, not objects.
# ruff: noqa: PLR0917

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evaluation.plant.compiled import compiled
from evaluation.plant.drive import approach, current, flows
from evaluation.plant.effects import slot
from evaluation.plant.layout import (
    AMBIENT,
    AMPERE,
    BURST,
    CELL_WIDTH,
    CELLS,
    COLUMNS,
    DUTY_X,
    DUTY_Y,
    FILL,
    FLAP,
    FORCE_X,
    FORCE_Y,
    FRACTION,
    GLANCE,
    GRAINS,
    HEATED_FROM,
    HELD_FORCE,
    I_X,
    ICE,
    INLET,
    LAST_SHOWN,
    LATE_SET,
    LOGGED,
    LUCK_X,
    OHM,
    PAIR_WIDTH,
    PASTED,
    PHASE_BEFORE,
    PLAY,
    RING_DUTY_X,
    RING_FORCE,
    RING_LENGTH,
    RING_X,
    RINGS,
    RTD_A,
    RTD_B,
    RUBBED_BEFORE,
    SIDE_WIDTH,
    SINCE_MOVED,
    SINK_WARM,
    SLEEVE,
    STEM,
    STOOD,
    TIME,
    TURNED,
    WALLS,
    WET,
    T,
    W,
    X,
)
from evaluation.plant.mechanics import equilibrium, wire_stress
from evaluation.plant.parameters import Bench
from evaluation.plant.sensors import read, truth
from evaluation.plant.thermal import ROW_WIDTH
from evaluation.plant.tube import tube
from evaluation.plant.water import HEATSINK

Array = NDArray[np.float64]

AMBIENT_DRIFT = slot("ambient_drift")
DRAUGHT_S = 90.0


@dataclass
class State:
    """Everything the plant remembers, as plain arrays (see `layout`), and its scratch space."""

    cells: Array
    side: Array
    pair: Array
    ring: Array
    rows: Array
    heat: Array
    scratch: Array

    def arrays(self) -> tuple[Array, Array, Array, Array, Array, Array, Array]:
        """The arrays in the order in which the compiled functions take them."""
        return self.cells, self.side, self.pair, self.ring, self.rows, self.heat, self.scratch


def at_rest(bench: Bench, effects: Array, *, water_degC: float, ambient_degC: float) -> State:
    """The pair conditioned, cold and still: all martensite, water and wire at `water_degC`.

    A second of settling removes the step that effects on the equilibrium would make at t = 0.
    """
    state = State(
        np.zeros((2, CELLS, CELL_WIDTH)),
        np.zeros((2, SIDE_WIDTH)),
        np.zeros(PAIR_WIDTH),
        np.zeros((RINGS, RING_LENGTH)),
        np.zeros((CELLS, ROW_WIDTH)),
        np.zeros(CELLS),
        np.zeros((4, CELLS, CELL_WIDTH)),
    )
    cells, side, pair = state.cells, state.side, state.pair
    cells[:, :, T] = water_degC
    cells[:, :, W] = water_degC
    cells[:, :, WET] = 1.0
    cells[:, :, FRACTION] = 1.0
    cells[:, :, HEATED_FROM] = 1.0
    cells[:, :, PLAY:] = 1.0
    cells[:, :, TURNED] = bench.turned_at_start
    side[:, FILL] = 1.0
    side[:, OHM] = bench.resistance_ohm, bench.resistance_ohm * bench.y_resistance
    side[:, RTD_A] = water_degC
    side[:, RTD_B] = water_degC
    side[:, LAST_SHOWN] = water_degC
    side[:, RUBBED_BEFORE] = 1.2
    side[:, PASTED] = water_degC
    side[:, LOGGED] = water_degC
    side[:, LATE_SET] = 1.0
    side[:, SLEEVE] = water_degC
    side[:, GRAINS] = 1.2
    side[:, PHASE_BEFORE] = 1.0
    side[:, BURST] = 1.0
    side[:, FLAP] = 1.0
    side[:, WALLS] = 1.0
    pair[ICE] = pair[STOOD] = 1.0
    pair[SINCE_MOVED] = 60.0
    side[:, STEM] = 0.3 * water_degC + 0.7 * ambient_degC
    pair[FORCE_X] = pair[FORCE_Y] = pair[HELD_FORCE] = 1.2
    quiet = np.zeros(8)
    quiet[INLET] = water_degC
    quiet[AMBIENT] = ambient_degC
    quiet[LUCK_X:] = 1.0
    ignored = np.zeros(len(COLUMNS))
    parameters = bench.vector()
    for _ in range(100):
        tick(parameters, effects, quiet, 0.01, *state.arrays(), ignored)
    pair[TIME] = 0.0
    return state


@compiled
def tick(
    p: Array,
    e: Array,
    u: Array,
    dt: float,
    cells: Array,
    side: Array,
    pair: Array,
    ring: Array,
    rows: Array,
    heat: Array,
    scratch: Array,
    out: Array,
) -> None:
    """Advance the whole plant by `dt` under inputs `u`; its readings and truths go to `out`."""
    pair[GLANCE] += 1.0
    now = int(pair[GLANCE]) % RING_LENGTH
    ring[RING_DUTY_X, now] = u[DUTY_X]
    ring[RING_DUTY_X + 1, now] = u[DUTY_Y]
    inlet = u[INLET]
    air = u[AMBIENT]
    if e[0, AMBIENT_DRIFT] != 0.0:
        air += e[0, AMBIENT_DRIFT] * math.sin(math.pi * pair[TIME] / DRAUGHT_S)
    flows(p, e, side, pair, ring, dt)
    if e[0, HEATSINK] > 0.0:
        total = side[0, AMPERE] + side[1, AMPERE]
        pair[SINK_WARM] = approach(pair[SINK_WARM], total / 4.0, dt, 15.0)
    for s in range(2):
        amperes = current(s, u[I_X + s], p, e, side, pair, dt)
        stress = wire_stress(s, p, e, cells, side, pair)
        tube(
            s,
            amperes,
            stress,
            inlet,
            air,
            u[LUCK_X + s],
            dt,
            p,
            e,
            cells,
            side,
            pair,
            heat,
            rows,
            scratch,
        )
    equilibrium(p, e, cells, side, pair, dt)
    ring[RING_X, now] = pair[X]
    ring[RING_FORCE, now] = pair[FORCE_X]
    read(inlet, u[AMBIENT], dt, p, e, cells, side, pair, ring, out)
    truth(cells, side, pair, out[11:])


@compiled
def replay(
    p: Array,
    e: Array,
    inputs: Array,
    dt: float,
    cells: Array,
    side: Array,
    pair: Array,
    ring: Array,
    rows: Array,
    heat: Array,
    scratch: Array,
    out: Array,
) -> None:
    """Run `inputs` (n, 8) open loop; readings and truths in `out` (n, columns)."""
    for k in range(inputs.shape[0]):
        tick(p, e, inputs[k], dt, cells, side, pair, ring, rows, heat, scratch, out[k])


def simulate(bench: Bench, inputs: Array, dt_s: float, effects: Array) -> dict[str, Array]:
    """Noise-free readings and truths of an open-loop run from rest.

    `inputs` has the columns of `layout.INPUTS`; the run starts with wire and water at its first
    inlet temperature. Returns one array per name in `layout.COLUMNS`.
    """
    state = at_rest(
        bench, effects, water_degC=float(inputs[0, INLET]), ambient_degC=float(inputs[0, AMBIENT])
    )
    out = np.zeros((len(inputs), len(COLUMNS)))
    replay(bench.vector(), effects, np.ascontiguousarray(inputs), dt_s, *state.arrays(), out)
    return {name: out[:, i] for i, name in enumerate(COLUMNS)}


def constant_inputs(
    seconds: float,
    dt_s: float,
    *,
    i_x: float = 0.0,
    i_y: float = 0.0,
    duty_x: float = 0.0,
    duty_y: float = 0.0,
    inlet: float = 26.85,
    ambient: float = 26.85,
) -> Array:
    """Inputs that hold for `seconds`."""
    row = np.array([i_x, i_y, duty_x, duty_y, inlet, ambient, 1.0, 1.0])
    return np.tile(row, (round(seconds / dt_s), 1))
