"""The five numbers that decide in the diagnosis, in one file.

`python -m evaluation calibrate` writes `constants.toml`, which says what they were fitted to. What
is defined, as how many terms can be read, stands where it is used.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec
import numpy as np

_EFFECTS = 40
"""Of the spring pair: a smaller library holds the cause less often."""


class Constants(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What was fitted to development benches (see `rivals/score.py` for the formula).

    `evidence` is κ, the independent pieces of evidence of each of ten channels: in all runs
    together for which cause it is, in each run for whether more than one is at work. Log prior odds
    beside a law at some place: `nothing` that nothing is missing, `parameters` that other values of
    them are the answer, `effect` that it is one of the library. The fewest rivals are told that
    together have the probability `credible_level`.
    """

    evidence: float
    nothing: float
    parameters: float
    effect: float
    credible_level: float

    @property
    def of_unknown(self) -> Constants:
        """The same where the simulator surely lacks something: without a part it stands for a cause
        that no rival describes, which is as likely as all places together."""
        return msgspec.structs.replace(self, nothing=0.0, parameters=0.0)

    def each_effect(self, effects: int) -> float:
        """Log prior of one of so many effects, which share that of all equally."""
        return self.effect - float(np.log(max(effects, _EFFECTS)))


@cache
def shipped() -> Constants:
    """The constants in the package."""
    source = files("smad.diagnosis") / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
