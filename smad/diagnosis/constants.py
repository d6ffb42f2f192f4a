"""The five numbers that decide in the diagnosis, in one file.

`python -m evaluation calibrate` writes `constants.toml`, which says what they were fitted to. What
is defined, as how many terms can be read, stands where it is used.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec


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


@cache
def shipped() -> Constants:
    """The constants in the package."""
    source = files("smad.diagnosis") / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
