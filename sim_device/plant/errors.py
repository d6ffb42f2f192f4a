"""Errors of the plant: each message names the cause, the value, the limit and what to do."""

from __future__ import annotations


class PlantError(Exception):
    """Base of everything that the plant refuses or cannot do."""


class ParameterError(PlantError):
    """A parameter file or a replacement value that is refused."""

    def __init__(self, name: str, message: str) -> None:
        super().__init__(f"{name}: {message}")
        self.name = name


class EffectError(PlantError):
    """An effect, or a parameter of one, that the registry does not know or does not allow."""


class ModelError(PlantError):
    """A model file that cannot be read."""


class InputError(PlantError):
    """A drive or a recorded input that the plant cannot take."""


class SolverError(PlantError):
    """The kernel gave up; carries the time and the state at which it did."""

    def __init__(self, message: str, *, time_s: float, state: dict[str, float]) -> None:
        values = ", ".join(f"{key} = {value:.6g}" for key, value in state.items())
        super().__init__(f"{message} at t = {time_s:.6g} s with {values}")
        self.time_s = time_s
        self.state = state
