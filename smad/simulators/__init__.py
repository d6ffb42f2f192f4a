"""Anybody's simulator as a plant of the diagnosis: a Python function, a MuJoCo model, an FMI unit.

Start with `simulator` and `diagnose`; docs/your-simulator.md shows both.
"""

from smad.simulators.asking import diagnose
from smad.simulators.declare import Missing, Simulator, simulator
from smad.simulators.planning import Plan, plan

__all__ = ["Missing", "Plan", "Simulator", "diagnose", "plan", "simulator"]
