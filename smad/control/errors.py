"""What stops a plan that runs."""

from smad.errors import SmadError


class PlanError(SmadError):
    """A plan did not come to its end: the board left ARMED, or a wait took too long."""


class BenchStoppedError(PlanError):
    """Board or host stopped the bench by a fault before a plan came to its end."""
