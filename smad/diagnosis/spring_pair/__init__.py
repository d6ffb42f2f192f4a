"""The spring pair as a plant of the diagnosis: an adapter of `sim_device.plant`."""

from smad.diagnosis.spring_pair.pair import SmaPlant
from smad.diagnosis.spring_pair.signals import read_gap_run

__all__ = ["SmaPlant", "read_gap_run"]
