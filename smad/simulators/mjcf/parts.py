"""Parts of a MuJoCo model by name, and the fields of them that a value sets.

A field is written in the compiled model for a replay, and in the specification for a file.
"""

import difflib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from smad.extras import part
from smad.records.units import convert
from smad.simulators.errors import SimulatorError
from smad.units import spelt, units_for

_LISTS = {"body": "nbody", "joint": "njnt", "actuator": "nu", "sensor": "nsensor"}


def number_of(model: Any, kind: str, name: str, key: str) -> int:
    """The number of a part. Raises SimulatorError for a name that the model does not have."""
    mujoco = part("mujoco")
    number = mujoco.mj_name2id(model, getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}"), name)
    if number < 0:
        names = names_of(model, kind)
        near = difflib.get_close_matches(name, names, n=3) or names
        raise SimulatorError(
            f"the model has no {kind} {name!r}, which the map has at {key}",
            limit=", ".join(near) or f"it has no named {kind}",
            action="correct the map, or name the part in the model",
        )
    return int(number)


def in_si(unit: str, target: str, key: str) -> float:
    """What one `unit` is in the SI unit `target`.

    Raises SimulatorError for a unit that is not known, or is of another kind.
    """
    units = units_for(target)
    if spelt(unit) not in units:
        raise SimulatorError(
            f"{key}: the unit contradicts the model's, which is {target}",
            value=unit,
            limit=", ".join(units),
            action="correct the unit, or name another part of the model",
        )
    return float(convert(np.ones(1), spelt(unit), target)[0])


def names_of(model: Any, kind: str) -> list[str]:
    """Names of all parts of a kind that have one, in the model's order."""
    mujoco = part("mujoco")
    of = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
    names = (mujoco.mj_id2name(model, of, k) for k in range(getattr(model, _LISTS[kind])))
    return [name for name in names if name]


def is_hinge(model: Any, joint: int, key: str) -> bool:
    """Whether a joint turns; a slide does not. Raises SimulatorError for ball and free joints."""
    kinds = part("mujoco").mjtJoint
    kind = int(model.jnt_type[joint])
    if kind not in (int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)):
        raise SimulatorError(
            f"{key} is of a joint that neither turns nor slides",
            limit="hinge, slide",
            action="map a hinge or a slide, or a sensor",
        )
    return kind == int(kinds.mjJNT_HINGE)


@dataclass(frozen=True)
class Field:
    """A field of the parts of one `kind`: how it is read from a model, and written to it.

    `units` are its unit, of a joint that of one that turns and that of one that slides.
    """

    kind: str
    read: Callable[[Any, int], float]
    write: Callable[[Any, int, float], None]
    units: tuple[str, ...] = ("",)


def _of_dof(name: str, *units: str) -> Field:
    return _array("joint", f"dof_{name}", lambda m, j: (m.jnt_dofadr[j],), *units)


def _array(
    kind: str, name: str, where: Callable[[Any, int], tuple[int, ...]], *units: str
) -> Field:
    def write(m: Any, k: int, value: float) -> None:
        getattr(m, name)[where(m, k)] = value

    return Field(kind, lambda m, k: float(getattr(m, name)[where(m, k)]), write, units)


def _write_mass(m: Any, b: int, value: float) -> None:
    m.body_inertia[b] *= value / m.body_mass[b]
    m.body_mass[b] = value


def _read_length(m: Any, b: int) -> float:
    return float(np.linalg.norm(m.body_ipos[b]))


def _write_length(m: Any, b: int, value: float) -> None:
    share = value / _read_length(m, b)
    m.body_ipos[b] *= share
    m.body_inertia[b] *= share**2
    for child in np.flatnonzero(m.body_parentid == b):
        if child:
            m.body_pos[child] *= share


def _write_kp(m: Any, a: int, value: float) -> None:
    m.actuator_biasprm[a, 1] *= value / m.actuator_gainprm[a, 0]
    m.actuator_gainprm[a, 0] = value


FIELDS: Mapping[str, Field] = {
    "mass": Field("body", lambda m, b: float(m.body_mass[b]), _write_mass, ("kg",)),
    "length": Field("body", _read_length, _write_length, ("m",)),
    "damping": _of_dof("damping", "N m s/rad", "N s/m"),
    "frictionloss": _of_dof("frictionloss", "N m", "N"),
    "armature": _of_dof("armature", "kg m²", "kg"),
    "stiffness": _array("joint", "jnt_stiffness", lambda m, j: (j,), "N m/rad", "N/m"),
    "springref": _array("joint", "qpos_spring", lambda m, j: (m.jnt_qposadr[j],), "rad", "m"),
    "gear": _array("actuator", "actuator_gear", lambda m, a: (a, 0), "1"),
    "kp": Field("actuator", lambda m, a: float(m.actuator_gainprm[a, 0]), _write_kp),
}
"""What a parameter of a map may be. `length`: of a body, from its frame to its centre of mass;
its inertia and where its children hang go along. `mass` takes the inertia along."""


def add_point_mass(m: Any, body: int, mass: float, place_m: Any) -> None:
    """Add a point mass at a point of a body's frame, with what it does to centre and inertia."""
    mujoco = part("mujoco")
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, m.body_iquat[body])
    R = rotation.reshape(3, 3)
    body_kg, centre = float(m.body_mass[body]), np.array(m.body_ipos[body])
    total = body_kg + mass
    new = (body_kg * centre + mass * np.asarray(place_m)) / total
    inertia = R @ np.diag(m.body_inertia[body]) @ R.T
    for part_mass, point in ((body_kg, centre), (mass, np.asarray(place_m))):
        d = point - new
        inertia += part_mass * (d @ d * np.eye(3) - np.outer(d, d))
    values, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, np.ascontiguousarray(axes).ravel())
    m.body_mass[body], m.body_ipos[body] = total, new
    m.body_inertia[body], m.body_iquat[body] = values, quat
