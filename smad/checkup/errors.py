"""Errors of check-ups. Each names the cause, the value, the limit and what to do next."""

from smad.diagnosis.errors import GapError


class ProgrammeError(GapError):
    """A programme cannot be read, or a bench could not play it safely."""


class BaselineError(GapError):
    """A baseline cannot be read, or does not belong to what is to be judged."""
