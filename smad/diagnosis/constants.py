"""The five constants of the decision, fitted to development benches.

`python -m evaluation calibrate` writes `constants.toml`, which names the data. Choices, such as the
number of terms of a law, stand where they are used.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec
import numpy as np

_EFFECTS = 40
"""Effects of the spring pair: a smaller library is less likely to hold the cause."""


class Constants(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Constants of the formula in `rivals/score.py`.

    `evidence` is κ, the independent observations in each of ten channels of a run. `nothing`,
    `parameters` and `effect` are log prior odds against a law at some place. A credible set is the
    smallest that has the probability `credible_level`.
    """

    evidence: float
    nothing: float
    parameters: float
    effect: float
    credible_level: float

    @property
    def of_unknown(self) -> Constants:
        """The constants where something is missing for certain: the rival without a part then
        stands for an unlisted cause, and is as likely as all places together.
        """
        return msgspec.structs.replace(self, nothing=0.0, parameters=0.0)

    def each_effect(self, effects: int) -> float:
        """Log prior of one effect; all `effects` share that of their kind equally."""
        return self.effect - float(np.log(max(effects, _EFFECTS)))


@cache
def shipped() -> Constants:
    """The constants in the package."""
    source = files("smad.diagnosis") / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
