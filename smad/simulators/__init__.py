"""Anybody's simulator as a plant of the diagnosis: a Python function, a MuJoCo model.

Start with `simulator` and `diagnose`; docs/your-simulator.md shows both.
"""

from smad.simulators.asking import diagnose
from smad.simulators.declare import Missing, Simulator, simulator
from smad.simulators.planning import plan

__all__ = ["Missing", "Simulator", "diagnose", "plan", "simulator"]
