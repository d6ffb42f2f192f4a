"""What goes wrong with an experiment, said so that the user can act on it."""

from smad.errors import SmadError


class ExperimentError(SmadError):
    """An experiment cannot be run, did not end, or its data do not support the analysis."""


class BenchLacksError(ExperimentError):
    """The bench has no sensor or actuator that the experiment needs. Nothing was moved."""


class EndedEarlyError(ExperimentError):
    """A reading left the recorded one, and the repeated inputs were ended; the log is kept."""


class TrippedError(ExperimentError):
    """Board or host stopped the bench by a fault during a run; what was recorded is kept."""


class StoppedError(ExperimentError):
    """Somebody, or a lost link, stopped the bench during a run; what was recorded is cut."""


class DataFileError(ExperimentError):
    """A data file (such as a calorimeter's) is not in the documented form."""
