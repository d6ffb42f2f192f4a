"""Errors of the check; each names the cause, the value, the limit and what to do next."""

from __future__ import annotations

from smad.diagnosis.errors import GapError


class BankError(GapError):
    """A bank folder, its manifest or a run file of it cannot be used."""


class CheckError(GapError):
    """A check cannot be run or gone on with as asked."""


class VerdictError(GapError):
    """A verdict file does not follow its form, or speaks of cases that the key does not have."""
