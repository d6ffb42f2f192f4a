"""Errors of the environments."""

from smad.errors import SmadError


class EnvError(SmadError):
    """An environment cannot be made or used as asked."""


class ActionRefused(EnvError):
    """An action lies outside its space."""


class PolicyFailed(EnvError):
    """A policy on the bench did not give an action; the bench was disarmed."""
