"""The errors of the diagnosis. Each names the cause, the value, the limit and what to do next."""

from smad.errors import SmadError


class GapError(SmadError):
    """The diagnosis cannot be made, or what it was given does not fit the plant."""


class RunRefused(GapError):
    """No run is left that can support the question."""


class PlantMismatch(GapError):
    """A run, a parameter file or a model file does not belong to this plant."""


class PairingError(GapError):
    """Runs of a good day and of now do not have the same inputs."""


class TooLittleRecorded(PairingError):
    """Runs of a good day and of now have too little in common to be judged."""
