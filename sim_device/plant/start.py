"""Where a pair starts: as it was mounted, or as runs before have left its springs."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sim_device.plant.errors import InputError
from sim_device.plant.parameters import ParameterSet, initial_detwinned, martensite_stiffness

_LIMITS = {"displacement_m": (-1.0, 1.0), "tension_N": (0.0, 1e4), "wires_K": (200.0, 400.0)}


@dataclass(frozen=True, kw_only=True)
class Start:
    """Where an antagonistic pair starts that is all martensite; None: as it was mounted.

    Both springs have the same tension; how far each is detwinned follows by Eq. (10) from that and
    its deflection. `wires_K` are the temperatures of X and Y, each with the water around it. Raises
    InputError for what no bench can be at.
    """

    displacement_m: float = 0.0
    tension_N: float | None = None
    wires_K: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name, (low, high) in _LIMITS.items():
            value = getattr(self, name)
            for x in value if isinstance(value, tuple) else (value,):
                # No comparison holds for NaN.
                if x is not None and not low <= x <= high:
                    raise InputError(f"{name} = {x} at the start; it must lie in {low} to {high}")


AS_MOUNTED = Start()


def within_reach(parameters: ParameterSet, start: Start) -> Start:
    """The start, cut to the tension and displacement that a pair of martensite can stand at.

    At a limit a spring is fully detwinned, or not at all.
    """
    tension_N = start.tension_N
    if tension_N is not None:
        longer_m = parameters["initial_deflection"]
        shorter_m = max(longer_m - parameters["max_deflection"], 0.0)
        stiffness = martensite_stiffness(parameters)
        tension_N = min(max(tension_N, stiffness * shorter_m), stiffness * longer_m)
    farthest_m = reach_m(parameters, tension_N)
    displacement_m = min(max(start.displacement_m, -farthest_m), farthest_m)
    return replace(start, displacement_m=displacement_m, tension_N=tension_N)


def reach_m(parameters: ParameterSet, tension_N: float | None = None) -> float:
    """How far from where it was mounted a pair can stand under a tension, all martensite."""
    detwinned = initial_detwinned(parameters, tension_N)
    return parameters["max_deflection"] * min(detwinned, 1.0 - detwinned)
