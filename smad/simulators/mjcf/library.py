"""What a MuJoCo model may lack: effects of joints and bodies, with sizes that suit the model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from smad.diagnosis.plant import Effect, EffectParameter
from smad.extras import part
from smad.simulators.mjcf.parts import FIELDS, add_point_mass, names_of, number_of

_SOME, _MOST = 0.05, 10.0
"""Of the largest torque, that friction and springs may well take; times that at most."""
_PLAY = (0.02, 0.3)
"""Of a radian, or of what a slide goes through: play as it may well be, and at most."""
_POSES = 64


@dataclass(frozen=True, kw_only=True)
class ModelEffect:
    """An effect that acts in the model: `write` adds it to a compiled model at these values."""

    effect: Effect
    write: Callable[[Any, Mapping[str, float]], None] = field(compare=False)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Sizes of one joint: largest torque or force in use, its inertia, and the rate of the two."""

    torque: float
    inertia: float

    @property
    def rate(self) -> float:
        """Of the oscillation that the torque and the inertia would make, rad/s."""
        return float(np.sqrt(self.torque / self.inertia))


def scale_of(m: Any, joint: int, driven: float) -> Scale:
    """The sizes of a joint whose actuators give at most `driven`.

    The torque of its weight is the largest of some poses.
    """
    mujoco = part("mujoco")
    d = mujoco.MjData(m)
    dof, address = int(m.jnt_dofadr[joint]), int(m.jnt_qposadr[joint])
    rng = np.random.default_rng(0)
    weight = 0.0
    for _ in range(_POSES):
        d.qpos[:] = m.qpos0
        d.qpos[address] = rng.uniform(*_turns(m, joint))
        mujoco.mj_forward(m, d)
        weight = max(weight, abs(float(d.qfrc_bias[dof])))
    mass = np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, d, mass)
    inertia = max(float(mass[dof, dof]), 1e-12)
    return Scale(torque=max(weight, driven) or inertia, inertia=inertia)


def _turns(m: Any, joint: int) -> tuple[float, float]:
    if m.jnt_limited[joint]:
        return float(m.jnt_range[joint, 0]), float(m.jnt_range[joint, 1])
    return -np.pi, np.pi


def joint_effects(
    m: Any, joint: str, scale: Scale, place: str, *, turns: bool
) -> list[ModelEffect]:
    """Dry and viscous friction, armature, and a spring with its rest, of one joint."""
    number = number_of(m, "joint", joint, "")
    unit, typical = ("N m" if turns else "N"), _SOME * scale.torque
    angle = "rad" if turns else "m"

    def added(key: str, strength: EffectParameter, title: str) -> ModelEffect:
        model_field = FIELDS[key]

        def write(model: Any, values: Mapping[str, float]) -> None:
            model_field.write(model, number, model_field.read(model, number) + values["size"])

        name = f"{joint}_{_NAMES[key]}"
        effect = Effect(
            name=name,
            title=f"{title} of joint {joint}",
            parameters=(strength,),
            signals=(),
            equation=f"{key} += size",
            places=(place,),
        )
        return ModelEffect(effect=effect, write=write)

    effects = [
        added("frictionloss", _size(unit, typical), "dry friction"),
        added("damping", _size(f"{unit} s/{angle}", typical / scale.rate), "viscous friction"),
        added("armature", _size("kg m²" if turns else "kg", 0.1 * scale.inertia), "armature"),
    ]
    return [*effects, _spring(joint, number, typical, place, (unit, angle))]


_NAMES = {
    "frictionloss": "dry_friction",
    "damping": "viscous_friction",
    "armature": "armature",
}


def _spring(
    joint: str, number: int, typical: float, place: str, units: tuple[str, str]
) -> ModelEffect:
    """More stiffness about a rest position of its own, beside what the model has."""
    unit, angle = units
    stiffness, rest = FIELDS["stiffness"], FIELDS["springref"]
    shape = f"{joint}_spring_rest"

    def write(model: Any, values: Mapping[str, float]) -> None:
        more = values["size"]
        was, rest_angle = stiffness.read(model, number), rest.read(model, number)
        # Two springs side by side are one, whose rest lies between theirs.
        stiffness.write(model, number, was + more)
        if was + more != 0.0:
            rest.write(model, number, (was * rest_angle + more * values[shape]) / (was + more))

    effect = Effect(
        name=f"{joint}_spring",
        title=f"spring at joint {joint}",
        parameters=(
            _size(f"{unit}/{angle}", typical),
            EffectParameter(
                name=shape, unit=angle, typical=0.0, low=-0.5, high=0.5, strength=False
            ),
        ),
        signals=(),
        equation="torque −= size · (position − rest)",
        places=(place,),
    )
    return ModelEffect(effect=effect, write=write)


def payload(m: Any, body: str, places: Sequence[str]) -> ModelEffect:
    """A point mass at a body: at its first site, else at its centre of mass."""
    number = number_of(m, "body", body, "payload_at")
    sites = np.flatnonzero(m.site_bodyid == number)
    body_kg = float(m.body_mass[number])
    centre = np.array(m.site_pos[sites[0]] if sites.size else m.body_ipos[number])

    def write(model: Any, values: Mapping[str, float]) -> None:
        add_point_mass(model, number, values["size"], centre)

    effect = Effect(
        name=f"{body}_payload",
        title=f"payload at {body}",
        parameters=(_size("kg", 0.1 * body_kg),),
        signals=(),
        equation="a point mass",
        places=tuple(places),
    )
    return ModelEffect(effect=effect, write=write)


def moving_bodies(m: Any) -> list[str]:
    """Named bodies with a mass that hang on a joint."""
    bodies = []
    for name in names_of(m, "body"):
        number = number_of(m, "body", name, "")
        if number and m.body_mass[number] > 0.0 and joints_above(m, number):
            bodies.append(name)
    return bodies


def joints_above(m: Any, body: int) -> list[int]:
    """Numbers of the joints between a body and the world, its own first."""
    joints: list[int] = []
    while body:
        first, count = int(m.body_jntadr[body]), int(m.body_jntnum[body])
        joints += range(first, first + count)
        body = int(m.body_parentid[body])
    return joints


def play(name: str, unit: str, whole: float) -> Effect:
    """Play between a joint and what reads its position; `whole`: see `_PLAY`."""
    typical, most = (share * whole for share in _PLAY)
    size = EffectParameter(name="size", unit=unit, typical=typical, low=0.0, high=most)
    return Effect(
        name=f"{name}_backlash",
        title=f"backlash between the joint and {name}",
        parameters=(size,),
        signals=(name,),
        equation="|shown − position| ≤ size",
        places=(f"reading_{name}",),
    )


def _size(unit: str, typical: float) -> EffectParameter:
    return EffectParameter(name="size", unit=unit, typical=typical, low=0.0, high=_MOST * typical)
