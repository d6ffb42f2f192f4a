"""What can go wrong when the simulated bench is asked for something it cannot do."""

from __future__ import annotations


class BenchError(Exception):
    """Base of the errors of the simulated bench."""


class FaultSpecError(BenchError):
    """A fault that does not exist, or one described wrongly."""


class RefusedError(BenchError):
    """The board refused a command given through the typed interface."""


class PortError(BenchError):
    """A pseudo-terminal or its link cannot be made."""
