"""The errors of simulators that are not ours."""

from smad.errors import SmadError


class SimulatorError(SmadError):
    """A simulator cannot be used, or does not fit the runs that it is asked about."""


class LostProcessError(SimulatorError):
    """A process that replays was killed from outside: no replay of it says anything."""
