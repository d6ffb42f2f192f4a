"""A MuJoCo model (MJCF) as a simulator: a map says what its parts are; the extra `mujoco`.

Start with `asked.diagnose_mjcf` and `model.MujocoModel`.
"""
