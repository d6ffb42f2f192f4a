"""Make arm.xml, map.toml and three runs in the current folder: python -m examples.pendulum

The model is a pendulum with viscous damping. The runs are of one that has dry friction as well.
docs/your-simulator.md diagnoses them.
"""

import shutil
from pathlib import Path

import mujoco
import numpy as np

MODEL = """<mujoco>
  <option timestep="0.005" integrator="implicitfast"/>
  <worldbody>
    <body name="arm">
      <joint name="hinge" axis="0 1 0" damping="0.05" FRICTION/>
      <geom type="capsule" size=".02" fromto="0 0 0 0 0 -.8" mass="1"/>
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="hinge"/></actuator>
</mujoco>"""


def main() -> None:
    """Write the files."""
    Path("arm.xml").write_text(MODEL.replace("FRICTION", ""))
    shutil.copy(Path(__file__).parent / "map.toml", "map.toml")
    for seed in range(3):
        rows, head = recorded(seed), "t_s,torque_N_m,angle_rad"
        np.savetxt(f"run{seed}.csv", rows, "%.4f", ",", header=head, comments="")


def recorded(seed: int) -> list[tuple[float, float, float]]:
    """The rows of one run: eight seconds of a random torque, the angle read with noise."""
    bench = mujoco.MjModel.from_xml_string(MODEL.replace("FRICTION", 'frictionloss="0.06"'))
    rng, data = np.random.default_rng(seed), mujoco.MjData(bench)
    t_s = np.arange(800) * 0.01
    torque = np.interp(t_s, np.arange(0, 8.5, 0.5), rng.uniform(-1.5, 1.5, 17))
    rows = []
    for k in range(800):
        rows.append((t_s[k], torque[k], data.qpos[0] + 1e-3 * rng.standard_normal()))
        data.ctrl[0] = torque[min(k + 1, 799)]  # in force until the next row's time
        mujoco.mj_step(bench, data, 2)
    return rows


if __name__ == "__main__":
    main()
