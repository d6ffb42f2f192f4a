"""Diagnosis of the gap between a simulator and its bench: where, because of what, how much goes.

`diagnose` runs the whole pipeline; each stage is a module that can be called alone. The engine
knows a plant only through `smad.gap.plant`; `smad.gap.sma` is the plant of this bench.
"""

from smad.gap.diagnose import diagnose
from smad.gap.records import Diagnosis
from smad.gap.settings import Settings

__all__ = ["Diagnosis", "Settings", "diagnose"]
