"""Which plants an environment draws: one model, ranges by hand, or what a diagnosis left open."""

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from sim_device.plant.draws import draw, draw_between, setup_of
from sim_device.plant.errors import PlantError
from sim_device.plant.models import Model, built_in, read_model
from sim_device.plant.parameters import BUILT_IN
from sim_device.plant.setup import Setup
from smad.envs.errors import EnvError

Ranges = Mapping[str, tuple[float, float]]
Randomise = None | str | Ranges | Callable[[Model, np.random.Generator], Model]
POSTERIOR = "posterior"


def model_of(source: str | Path | Model) -> Model:
    """A built-in parameter set by name, a model file, or a model as it is.

    Raises EnvError for a file that is not a model of the spring pair.
    """
    if isinstance(source, Model):
        return source
    if str(source) in BUILT_IN:
        return built_in(str(source))
    try:
        return read_model(source)
    except PlantError as error:
        raise EnvError(
            "this is not a model of the spring pair",
            value=str(error),
            action="give a file that smad gap diagnose --apply or save_model wrote",
        ) from None


class Source:
    """Where plants come from: `setup(rng)` gives one for an episode.

    randomise: None (always the model), "posterior" (from the covariance of the model file), ranges
    by hand (name to (low, high), SI), or a function of model and generator.
    Raises EnvError for what cannot be drawn from.
    """

    def __init__(self, model: str | Path | Model, randomise: Randomise = None) -> None:
        self.model, self._randomise = model_of(model), randomise
        self._fixed = setup_of(self.model) if randomise is None else None
        if isinstance(randomise, str) and randomise != POSTERIOR:
            raise EnvError(
                "unknown way to randomise", value=randomise, limit=f"{POSTERIOR}, ranges, None"
            )
        if randomise is not None:
            self.drawn(np.random.default_rng(0))

    def drawn(self, rng: np.random.Generator) -> Model:
        """One model."""
        try:
            if self._randomise is None:
                return self.model
            if isinstance(self._randomise, str):
                return draw(self.model, rng)
            if isinstance(self._randomise, Mapping):
                return draw_between(self.model, self._randomise, rng)
            return self._randomise(self.model, rng)
        except PlantError as error:
            raise EnvError("no plant can be drawn", value=str(error)) from None

    def setup(self, rng: np.random.Generator) -> Setup:
        """One model as the kernel takes it."""
        return self._fixed if self._fixed is not None else setup_of(self.drawn(rng))
