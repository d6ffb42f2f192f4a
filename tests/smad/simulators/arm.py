"""A pendulum in MuJoCo, its map, and runs of one that has more than the model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from smad.diagnosis.plant import Array

DT = 0.01
MODEL = """<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <body name="arm">
      <joint name="hinge" axis="0 1 0" damping="0.05"/>
      <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.8" mass="1"/>
      <site name="tip" pos="0 0 -.8"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="hinge"/></actuator>
  <sensor><actuatorfrc name="pull" actuator="motor"/></sensor>
</mujoco>
"""
MAP = """
[inputs.torque_N_m]
actuator = "motor"

[channels.angle_rad]
joint = "hinge"

[parameters.mass_kg]
field = "mass"
of = "arm"
low = 0.5
high = 2.0

[parameters.damping]
field = "damping"
of = "hinge"
low = 0.0
high = 0.3
"""


def files(folder: Path, model: str = MODEL, mapped: str = MAP) -> tuple[Path, Path]:
    (folder / "arm.xml").write_text(model)
    (folder / "map.toml").write_text(mapped)
    return folder / "arm.xml", folder / "map.toml"


def nothing(model: Any) -> None:
    """Leave a model as it is."""


def rubbing(model: Any) -> None:
    """A bench that is a little heavier, and rubs."""
    model.body_mass[1] *= 1.1
    model.body_inertia[1] *= 1.1
    model.dof_frictionloss[0] = 0.06


def arm_run(
    seed: int,
    change: Callable[[Any], None] = nothing,
    *,
    seconds: float = 12.0,
    noise: float = 1e-3,
) -> dict[str, Array]:
    model = mujoco.MjModel.from_xml_string(MODEL)
    change(model)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(seconds / DT)) * DT
    knots = np.arange(0.0, seconds + 0.5, 0.5)
    torque = np.interp(t_s, knots, rng.uniform(-1.5, 1.5, len(knots)))
    angle = np.empty(len(t_s))
    for k in range(len(t_s)):
        angle[k] = data.qpos[0]
        data.ctrl[0] = torque[min(k + 1, len(t_s) - 1)]
        mujoco.mj_step(model, data, 2)
    angle = np.round(angle + noise * rng.standard_normal(len(t_s)), 4) if noise else angle
    return {"t_s": t_s, "torque_N_m": torque, "angle_rad": angle}
