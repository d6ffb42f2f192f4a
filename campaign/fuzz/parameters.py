"""Parameter files: refused with the entry's name, or every value finite and within its limits."""

from __future__ import annotations

import math

from campaign.fuzz.files import file_with
from campaign.fuzz.program import require
from sim_device.plant.errors import ParameterError
from sim_device.plant.fields import FIELDS, ORDERINGS
from sim_device.plant.parameters import ParameterSet, load_parameters, parameters_text

_SLACK = 1e-9


def run(data: bytes) -> None:
    """The input is the file."""
    try:
        parameters = load_parameters(file_with("parameters.toml", data))
    except ParameterError as error:
        require(error.name and str(error).startswith(error.name), "a refusal without a name")
        return
    within_limits(parameters)
    for entry in parameters.entries:
        require(_in(entry.value, entry.low, entry.high), "{} is out of the file's range", entry)
    again = load_parameters(file_with("again.toml", parameters_text(parameters).encode()))
    for entry, other in zip(parameters.entries, again.entries, strict=True):
        require(
            math.isclose(entry.value, other.value, rel_tol=_SLACK, abs_tol=1e-300)
            and entry.source == other.source,
            "written out, {} reads as {}",
            entry,
            other,
        )


def within_limits(parameters: ParameterSet) -> None:
    """Require the hard physical limits and the orderings of the table."""
    for field, entry in zip(FIELDS, parameters.entries, strict=True):
        require(
            math.isfinite(entry.value) and _in(entry.value, field.low, field.high),
            "{} is out of its physical limits",
            entry,
        )
    for small, large in ORDERINGS:
        require(parameters[small] < parameters[large], "{} is not below {}", small, large)


def _in(value: float, low: float, high: float) -> bool:
    slack = _SLACK * max(abs(low), abs(high))
    return low - slack <= value <= high + slack
