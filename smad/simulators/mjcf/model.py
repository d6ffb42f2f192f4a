"""A MuJoCo model as a function of time, inputs, values and start (`declare.Replay`)."""

import threading
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from sim_device.plant.units import UNITS
from smad.diagnosis.plant import Array, Effect
from smad.extras import part
from smad.records.column_names import unit_in
from smad.simulators.errors import SimulatorError
from smad.simulators.mjcf.library import ModelEffect
from smad.simulators.mjcf.map_file import ChannelRow, InputRow, MjcfMap, ParameterRow
from smad.simulators.mjcf.parts import FIELDS, Field, in_si, is_hinge, number_of
from smad.units import convertible, spelt, unit_of

_TOUCHED = (
    "body_mass", "body_inertia", "body_ipos", "body_iquat", "body_pos", "dof_damping",
    "dof_frictionloss", "dof_armature", "jnt_stiffness", "qpos_spring", "actuator_gear",
    "actuator_gainprm", "actuator_biasprm",
)  # fmt: skip
"""Fields of a compiled model that a value may change; the rest stays as it was compiled."""
_OF_JOINTS = {"JOINTPOS": "position", "JOINTVEL": "velocity"}
"""Sensors that show the state of a joint, from which a replay begins."""
_SENSED = {
    **dict.fromkeys(("RANGEFINDER", "FRAMEPOS"), "m"), "GYRO": "rad/s", "FRAMEANGVEL": "rad/s",
    **dict.fromkeys(("VELOCIMETER", "FRAMELINVEL"), "m/s"), "FORCE": "N", "TOUCH": "N",
    "TORQUE": "N m",
}  # fmt: skip
"""Units of other sensors; what is not listed is taken as it stands."""
_CONTROLS = {
    "deg": "rad", "deg/s": "rad/s", "m": "m", "m/s": "m/s", "N": "N", "N m": "N m",
}  # fmt: skip
"""What mechanics is measured in, by the base unit of `UNITS`: so an actuator takes it."""
_ROUNDED = 1e-3
"""Of a ctrlrange, by which a control may be beyond it."""


def load(path: Path) -> Any:
    """The specification of an MJCF file. Raises SimulatorError for one that is none."""
    mujoco = part("mujoco")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        spec.compile()
    except (ValueError, OSError) as error:
        raise SimulatorError(
            f"{path} is not a MuJoCo model", value=str(error), action="open it in MuJoCo's viewer"
        ) from error
    return spec


@dataclass(frozen=True)
class Driven:
    """An input: the column of the control vector that it fills, as scale · input + offset."""

    name: str
    column: int
    scale: float
    offset: float
    late: bool


@dataclass(frozen=True)
class Output:
    """An output: of positions, velocities or sensors the number, as scale · value + offset.

    `turns`: it is of a joint that turns.
    """

    name: str
    source: str
    number: int
    scale: float
    offset: float
    turns: bool = False


class MujocoModel:
    """Replays of one model; see `Replay` for how it is called.

    Torques of joints that no run has are inputs named `JOINT_torque`. Safe to call from several
    threads, one after the other. NaN where the simulation becomes unstable.
    """

    def __init__(self, spec: Any, mapped: MjcfMap) -> None:
        self._mujoco = part("mujoco")
        part("mujoco.rollout")
        self.spec, self.mapped = spec, mapped
        self.model = spec.compile()
        self._data = self._mujoco.MjData(self.model)
        self._as_compiled = {n: np.array(getattr(self.model, n)) for n in _TOUCHED}
        self._lock = threading.Lock()
        self.joints = self._joints()
        self.assumed_units: dict[str, str] = {}
        self.notes: list[str] = []
        self.driven = [self._input(n, r) for n, r in mapped.inputs.items()]
        self.outputs = [self._channel(n, r) for n, r in mapped.channels.items()]
        self._parameters = {n: self._field(n, r) for n, r in mapped.parameters.items()}
        self.effects: Sequence[ModelEffect] = ()
        self.plays: Sequence[tuple[str, Effect]] = ()

    def _field(self, name: str, row: ParameterRow) -> tuple[Field, int]:
        if row.field not in FIELDS:
            raise SimulatorError(
                f"parameters.{name}.field cannot be refitted",
                value=row.field,
                limit=", ".join(FIELDS),
                action="correct the map",
            )
        field = FIELDS[row.field]
        return field, number_of(self.model, field.kind, row.of, f"parameters.{name}")

    def _joints(self) -> dict[str, int]:
        """Joints that turn or slide, by name."""
        m, kinds = self.model, self._mujoco.mjtJoint
        plain = (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE))
        names = {
            j: self._mujoco.mj_id2name(m, self._mujoco.mjtObj.mjOBJ_JOINT, j) for j in range(m.njnt)
        }
        return {n: j for j, n in names.items() if n and int(m.jnt_type[j]) in plain}

    def _input(self, name: str, row: InputRow) -> Driven:
        m, key = self.model, f"inputs.{name}"
        if row.actuator:
            column, scale = number_of(m, "actuator", row.actuator, key), 1.0
            unit = spelt(self.unit(name, row))
            target = _CONTROLS.get(UNITS[unit].si, unit) if row.plain and unit in UNITS else unit
            if unit != target:
                scale = in_si(unit, target, key)
                self.notes.append(f"{name} is given to actuator {row.actuator} in {target}")
        else:
            joint = number_of(m, "joint", row.joint, key)
            unit = "N m" if is_hinge(m, joint, key) else "N"
            column = m.nu + int(m.jnt_dofadr[joint])
            scale = self._in_si(name, row, unit, key)
        late = (row.held or self.mapped.held) == "from"
        return Driven(name, column, scale * row.scale, row.offset, late)

    def _channel(self, name: str, row: ChannelRow) -> Output:
        m, key = self.model, f"channels.{name}"
        joint = row.joint or row.velocity_of
        number = number_of(m, "joint", joint, key) if joint else -1
        source = "velocity" if row.velocity_of else "position"
        if row.sensor:
            sensor = number_of(m, "sensor", row.sensor, key)
            if row.index >= m.sensor_dim[sensor]:
                raise SimulatorError(
                    f"{key}: sensor {row.sensor} has no such value",
                    value=row.index,
                    limit=f"0 to {m.sensor_dim[sensor] - 1}",
                    action="correct index",
                )
            kind = self._mujoco.mjtSensor(m.sensor_type[sensor]).name.removeprefix("mjSENS_")
            if kind not in _OF_JOINTS or m.sensor_cutoff[sensor]:
                unit = self._in_si(name, row, _SENSED[kind], key) if kind in _SENSED else 1.0
                column = int(m.sensor_adr[sensor]) + row.index
                return Output(name, "sensor", column, row.scale / unit, row.offset)
            number, source = int(m.sensor_objid[sensor]), _OF_JOINTS[kind]
        turns, per_s = is_hinge(m, number, key), "/s" if source == "velocity" else ""
        unit = self._in_si(name, row, f"{'rad' if turns else 'm'}{per_s}", key)
        column = int((m.jnt_dofadr if source == "velocity" else m.jnt_qposadr)[number])
        return Output(name, source, column, row.scale / unit, row.offset, turns)

    def clipped(self, columns: Mapping[str, Array]) -> list[str]:
        """What is said of inputs that go beyond what their actuators take."""
        m, said = self.model, []
        clamped = not m.opt.disableflags & int(self._mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL)
        for x in (x for x in self.driven if x.column < m.nu and x.name in columns):
            low, high = m.actuator_ctrlrange[x.column].tolist()
            control = x.scale * columns[x.name] + x.offset
            ends = float(np.nanmin(control)), float(np.nanmax(control))
            beyond = max(low - ends[0], ends[1] - high) > _ROUNDED * (high - low)
            if beyond and clamped and m.actuator_ctrllimited[x.column]:
                said.append(
                    f"{x.name} asks for controls from {ends[0]:.4g} to {ends[1]:.4g}, and the "
                    f"model clips them to the ctrlrange, {low:g} to {high:g}: is its unit right?"
                )
        return said

    @property
    def hinge(self) -> int:
        """The type of a joint that turns."""
        return int(self._mujoco.mjtJoint.mjJNT_HINGE)

    def is_motor(self, actuator: int) -> bool:
        """Whether an actuator is a torque at its joint, whatever the joint does."""
        m, mujoco = self.model, self._mujoco
        return (
            int(m.actuator_gaintype[actuator]) == int(mujoco.mjtGain.mjGAIN_FIXED)
            and int(m.actuator_biastype[actuator]) == int(mujoco.mjtBias.mjBIAS_NONE)
            and int(m.actuator_dyntype[actuator]) == int(mujoco.mjtDyn.mjDYN_NONE)
            and int(m.actuator_trntype[actuator]) == int(mujoco.mjtTrn.mjTRN_JOINT)
        )

    def unit(self, name: str, row: InputRow | ChannelRow) -> str:
        """The unit of a column: as the map, its name there or in the run has it, or as assumed."""
        named = row.unit or unit_of(name) or spelt(row.column_unit) or unit_in(row.column or name)
        return named or self.assumed_units.get(name, "")

    def _in_si(self, name: str, row: InputRow | ChannelRow, target: str, key: str) -> float:
        """What one unit of a column is in the model's, which is assumed where none is given."""
        if not self.unit(name, row):
            self.assumed_units[name] = target
        unit = self.unit(name, row)
        # Scale and offset of a sensor, or to a volt of a potentiometer, are of the model's unit.
        sensed = isinstance(row, ChannelRow) and row.sensor
        scaled = not row.plain and (sensed or not convertible(spelt(unit), target))
        return 1.0 if scaled else in_si(unit, target, key)

    def nominal(self, name: str) -> float:
        """What the model has for a parameter of the map."""
        field, number = self._parameters[name]
        return field.read(self.model, number)

    def unit_of_field(self, name: str) -> str:
        """The unit of a parameter of the map."""
        field, number = self._parameters[name]
        turns = field.kind == "joint" and self.model.jnt_type[number] == self.hinge
        return field.units[0 if turns or field.kind != "joint" else 1]

    def with_values(self, values: Mapping[str, float]) -> Any:
        """The model with these values in it; it stays so until the next call."""
        for name, compiled in self._as_compiled.items():
            getattr(self.model, name)[:] = compiled
        self.write(self.model, values)
        return self.model

    def write(self, m: Any, values: Mapping[str, float]) -> None:
        """Write values to a model that is as it was compiled."""
        for name, (field, number) in self._parameters.items():
            if values[name] != field.read(m, number):
                field.write(m, number, values[name])
        for e in self.effects:
            effect = e.effect
            if values[effect.name] != 0.0:
                shapes = {q.name: values[q.name] for q in effect.parameters if not q.strength}
                e.write(m, {"size": values[effect.name], **shapes})

    def __call__(
        self,
        t: Array,
        inputs: Mapping[str, Array],
        values: Mapping[str, float],
        start: Mapping[str, float],
    ) -> dict[str, Array]:
        """Outputs of the map at times `t`."""
        with self._lock:
            grid, pieces = self._grid(t)
            m = self.with_values(values)
            m.opt.timestep = float(grid[1]) / pieces if len(grid) > 1 else self._step_s
            self._begin(start)
            outputs = self._rolled(self._control(t, grid, inputs), pieces)
        if not (len(grid) == len(t) and np.allclose(grid, t, atol=1e-6 * max(grid[-1], 1e-9))):
            outputs = {n: np.interp(t, grid, y) for n, y in outputs.items()}
        for channel, effect in self.plays:
            if values[effect.name] > 0.0:
                outputs[channel] = _followed(outputs[channel], values[effect.name])
        return outputs

    def _grid(self, t: Array) -> tuple[Array, int]:
        """Equal times over a run, and how many steps of the model there are in one of them."""
        dt_s = float(np.median(np.diff(t))) if len(t) > 1 else self.model.opt.timestep
        count = round(float(t[-1]) / dt_s) + 1
        pieces = max(1, int(np.ceil(dt_s / self._step_s - 1e-9)))
        return np.arange(count) * dt_s, pieces

    @property
    def _step_s(self) -> float:
        return float(self.spec.option.timestep)

    def _control(self, t: Array, grid: Array, inputs: Mapping[str, Array]) -> Array:
        """Controls and applied torques in force from each time of a grid on, (n, nu + nv)."""
        m = self.model
        control = np.zeros((len(grid), m.nu + m.nv))
        for x in self.driven:
            control[:, x.column] += x.scale * _held(inputs[x.name], t, grid, x.late) + x.offset
        for joint, number in self.joints.items():
            pushed = _held(inputs[f"{joint}_torque"], t, grid, late=True)
            control[:, m.nu + int(m.jnt_dofadr[number])] += pushed
        return control

    def _rolled(self, control: Array, pieces: int) -> dict[str, Array]:
        """Outputs at the times of a grid, from where the data stand, in so many steps for each."""
        mujoco, m, d = self._mujoco, self.model, self._data
        spec = mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_QFRC_APPLIED
        physics = mujoco.mjtState.mjSTATE_FULLPHYSICS
        first = np.zeros(mujoco.mj_stateSize(m, physics))
        mujoco.mj_getState(m, d, first, physics)
        steps = (len(control) - 1) * pieces + 1
        with _quiet(mujoco):
            states, sensors = mujoco.rollout.rollout(
                m,
                d,
                first[None],
                np.repeat(control, pieces, axis=0)[None, :steps],
                control_spec=int(spec),
                skip_checks=False,
            )
        if d.warning.number.any():
            return {x.name: np.full(len(control), np.nan) for x in self.outputs}
        # A state is that after its step, sensors are those before it.
        before = np.vstack([first, states[0][:-1]])[::pieces]
        of = {
            "position": before[:, 1 : 1 + m.nq],
            "velocity": before[:, 1 + m.nq : 1 + m.nq + m.nv],
            "sensor": sensors[0][::pieces],
        }
        return {x.name: x.scale * of[x.source][:, x.number] + x.offset for x in self.outputs}

    def _begin(self, start: Mapping[str, float]) -> None:
        """Joints that are measured begin where they were shown to be, the others as compiled."""
        m, d = self.model, self._data
        self._mujoco.mj_setConst(m, d)
        self._mujoco.mj_resetData(m, d)
        for x in self.outputs:
            if x.source == "position":
                d.qpos[x.number] = (start[x.name] - x.offset) / x.scale
                joint = int(np.flatnonzero(m.jnt_qposadr == x.number)[0])
                d.qvel[m.jnt_dofadr[joint]] = start[f"{x.name}_rate"] / x.scale
        for x in self.outputs:
            if x.source == "velocity":
                d.qvel[x.number] = (start[x.name] - x.offset) / x.scale


def _held(column: Array, t: Array, grid: Array, late: bool) -> Array:
    """A column from each of equal times on: the row in force then, until its time or from it on."""
    rows = np.arange(len(t)) + (not late)
    if len(grid) != len(t):
        # In the middle, where a time that is a little off changes nothing.
        rows = np.searchsorted(t, grid + 0.5 * grid[1]) - late
    return np.asarray(column)[np.clip(rows, 0, len(t) - 1)]


@contextmanager
def _quiet(mujoco: Any) -> Any:
    """Warnings of an unstable simulation go to nobody: the model is dropped and said."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


@njit(cache=True, nogil=True)
def _followed(position: Array, play: float) -> Array:
    out = np.empty(len(position))
    reading = position[0]
    for k in range(len(position)):
        reading = min(max(reading, position[k] - play), position[k] + play)
        out[k] = reading
    return out
