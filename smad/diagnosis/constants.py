"""The numbers of the diagnosis that were fitted to development benches, in one file.

`python -m evaluation calibrate` writes `constants.toml`, which says what they were fitted to. What
is defined, as how many terms can be read, stands where it is used.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec


class Constants(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What was fitted to development benches.

    Odds of laws and effects (`search/odds.py`): an effect of the library has the log odds
    `effect_odds` beside a law that takes as much. `effect_weight` and `law_weight` are what the log
    of the share that each takes counts. As few places are told as hold `told_level` of the
    probability together.

    Check-ups: rows of a bench without a change have the variance `quiet_variance`. It has changed
    when the best law takes `quiet_gain` of the sum of squares, or the parameters
    `quiet_parameters`. If these take that much, other values of the parameters are the answer where
    the first place takes less than `parameters_form` times the root of what they take times the
    number of rows.
    """

    effect_odds: float
    effect_weight: float
    law_weight: float
    told_level: float
    parameters_form: float
    quiet_variance: float
    quiet_gain: float
    quiet_parameters: float


@cache
def shipped() -> Constants:
    """The constants in the package."""
    source = files("smad.diagnosis") / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
