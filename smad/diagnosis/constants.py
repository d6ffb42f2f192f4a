"""Every number that decides where a change lies and what law is missing there, in one file.

`constants.toml` beside it says on which development banks they were chosen.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec


class Constants(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What decides.

    A law has at most `most_terms` terms, the answer of a check-up or of *changed* at most
    `most_places` places, a list of *differs* at most `most_listed`. A place enters when it takes
    `place_share`.

    Odds of laws and effects (`search/odds.py`): an effect of the library has the log odds
    `effect_odds` beside a law that takes as much. `effect_weight` and `law_weight` are what the log
    of the share that each takes counts. As few places are told as hold `told_level` of the
    probability together; an effect is the name from `name_level` on.

    Check-ups: rows of a bench without a change have the variance `quiet_variance`. It has changed
    when the best law takes `quiet_gain` of the sum of squares, or the parameters
    `quiet_parameters`, or the mean square is `quiet_ratio` (floors are so wide that it stays below
    1 where nothing has changed).
    Places are told in place of other values of the parameters when their law takes `quiet_gain` and
    they leave less than these do; of what these take, `slopes_trusted` may be left for the form of
    their slopes. A run is played
    again to tell places apart when their laws differ on it by `separation` (d²).

    Differs: a gap below `quiet_floors` floors is none.

    Changed: a place, or other values of the parameters, are new when they add `changed_share` of
    the rows in question, and runs of one kind would differ so with probability `chance` at most.
    Parameters are the answer when they take `parameters_first` of what places take.

    Either: a run is not of one state with the others when it is above the floor and coefficients of
    its own take `apart_share` of it.
    """

    most_terms: int
    most_places: int
    most_listed: int
    place_share: float
    effect_odds: float
    effect_weight: float
    law_weight: float
    told_level: float
    name_level: float
    slopes_trusted: float
    quiet_variance: float
    quiet_gain: float
    quiet_parameters: float
    quiet_ratio: float
    separation: float
    quiet_floors: float
    changed_share: float
    chance: float
    parameters_first: float
    apart_share: float


@cache
def shipped() -> Constants:
    """The constants in the package."""
    source = files("smad.diagnosis") / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
