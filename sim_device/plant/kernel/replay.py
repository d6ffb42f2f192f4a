"""Recorded samples through the plant in one call."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from sim_device.plant.kernel.compiled import entry, inlined
from sim_device.plant.kernel.curves import Row
from sim_device.plant.kernel.forcing import FIRST_READING, force_readings
from sim_device.plant.kernel.layout import OneRecord
from sim_device.plant.kernel.state import Driven, Feeds, State, Work
from sim_device.plant.kernel.step import OK, advance, wake_sensors
from sim_device.plant.kernel.supply import drive_current

Array = npt.NDArray[np.float64]


@inlined
def load_feeds(feeds: Feeds, flags: Row, rows: Array, k: int) -> None:
    """Feeds of the sample that ends at row k. Rows: i_x, i_y, T_x, T_y, F, u, inlet, ambient."""
    feeds.feeds_current = flags[0]
    feeds.feeds_temperature = flags[1]
    feeds.feeds_force = flags[2]
    feeds.feeds_displacement = flags[3]
    feeds.feeds_surroundings = flags[4]
    feeds.x.current = rows[k, 0]
    feeds.y.current = rows[k, 1]
    feeds.x.T_start = rows[k - 1, 2]
    feeds.y.T_start = rows[k - 1, 3]
    feeds.x.T_end = rows[k, 2]
    feeds.y.T_end = rows[k, 3]
    feeds.force_start = rows[k - 1, 4]
    feeds.force_end = rows[k, 4]
    feeds.displacement_start = rows[k - 1, 5]
    feeds.displacement_end = rows[k, 5]
    feeds.T_inlet = rows[k, 6]
    feeds.T_air = rows[k, 7]


@inlined
def load_drive(drive: Driven, row: Row) -> None:
    """What the board applies, from a row of `Inputs.rows`."""
    drive.i_x = row[0]
    drive.i_y = row[1]
    drive.duty_x = row[2]
    drive.duty_y = row[3]
    drive.drain_x = row[4]
    drive.drain_y = row[5]
    drive.stage = row[6]


@inlined
def count_substeps(span: float, dt_max: float) -> int:
    """How many even substeps of at most `dt_max` a sample takes."""
    return max(math.ceil(span / dt_max - 1e-9), 1)


@inlined
def load_forcing(state: State, work: Work, forcing: Array, k: int, span: float) -> None:
    """Forcing of the sample that ends at row k and lasts `span`, by slot; at a reading it is added
    to what the sensor is given."""
    if forcing.shape[0] > 0:
        per_span = 1.0 / span if span > 0.0 else 0.0
        for j in range(FIRST_READING):
            work.held[j] = forcing[k, j]
        added = state.shared.added
        rate = state.shared.added_rate
        rate.rtd_x = (forcing[k, FIRST_READING + 4] - added.rtd_x) * per_span
        rate.rtd_y = (forcing[k, FIRST_READING + 5] - added.rtd_y) * per_span
        rate.displacement = (forcing[k, FIRST_READING + 8] - added.displacement) * per_span
        added.i_x = forcing[k, FIRST_READING]
        added.i_y = forcing[k, FIRST_READING + 1]
        added.v_x = forcing[k, FIRST_READING + 2]
        added.v_y = forcing[k, FIRST_READING + 3]
        added.rtd_x = forcing[k, FIRST_READING + 4]
        added.rtd_y = forcing[k, FIRST_READING + 5]
        added.rtd_inlet = forcing[k, FIRST_READING + 6]
        added.rtd_air = forcing[k, FIRST_READING + 7]
        added.displacement = forcing[k, FIRST_READING + 8]
        added.force = forcing[k, FIRST_READING + 9]


@entry
def replay(
    states: OneRecord,
    works: OneRecord,
    models: OneRecord,
    ring: Array,
    table: Array,
    flags: Row,
    rows: Array,
    drives: Array,
    env: Array,
    forcing: Array,
    laws: Array,
    memory: Array,
    times: Row,
    dt_max: float,
    flat: Row,
    slots: Row,
    out: Array,
) -> int:
    """Advance through recorded samples; row k of `drives` is in force up to times[k].

    flags (5,) and rows (n, 8), or no row: which signals are fed, and the signals, see
    `load_feeds`. env (n, 2): inlet and ambient, K. forcing (n, FORCED_SLOTS), or no row: what is
    forced at each place. laws (m, 17), memory (m, 4): as of `advance`. flat: the numbers of the
    state. out (len(slots), n): those of them at `slots` after each sample. Returns a status.
    """
    state, work, model = states[0], works[0], models[0]
    work.forces = 1.0 if forcing.shape[0] > 0 or laws.shape[0] > 0 else 0.0
    for k in range(drives.shape[0]):
        state.shared.given_inlet = env[k, 0]
        state.shared.given_air = env[k, 1]
        if k == 0:
            load_forcing(state, work, forcing, k, 0.0)
            wake_sensors(state, model, ring)
            if work.forces > 0.0:
                force_readings(state, work, laws, memory, 0.0)
        else:
            span = times[k] - times[k - 1]
            steps = count_substeps(span, dt_max)
            if rows.shape[0] > 0:
                load_feeds(work.feeds, flags, rows, k)
            load_drive(work.drive, drives[k])
            load_forcing(state, work, forcing, k, span)
            status = advance(states, works, models, ring, table, laws, memory, span / steps, steps)
            if status != OK:
                return status
        for j in range(out.shape[0]):
            out[j, k] = flat[int(slots[j])]
    return OK


@entry
def replay_drivers(
    states: OneRecord, models: OneRecord, drives: Array, times: Row, dt_max: float, out: Array
) -> None:
    """The drivers alone, as in `replay`: nothing else of the plant acts on a current.

    out (n, 4): currents of x and y as they are measured, then as they are, after each sample.
    """
    x, y, model = states[0].x, states[0].y, models[0]
    for k in range(drives.shape[0]):
        if k > 0:
            span = times[k] - times[k - 1]
            steps = count_substeps(span, dt_max)
            dt = span / steps
            for _ in range(steps):
                x.current, _, _ = drive_current(x, model.p, model.x, drives[k, 0], dt)
                y.current, _, _ = drive_current(y, model.p, model.y, drives[k, 1], dt)
        out[k, 0] = x.current + model.x.current_offset
        out[k, 1] = y.current + model.y.current_offset
        out[k, 2] = x.current
        out[k, 3] = y.current
