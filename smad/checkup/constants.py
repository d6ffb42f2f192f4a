"""The few constants of the decision, from one TOML that a command writes."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec


class Constants(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Limits in white space, where a row without a change has variance 1.

    A bench has changed when the best entry takes more than `quiet_gain` off the sum of squares, or
    the mean square of all rows exceeds `quiet_ratio`, or that of one channel `channel_ratio`. Then
    rows have the variance 1 + `form_share`² G, G being what the best entry takes, since its
    law has another form than the bench's. Other values of parameters lie within `free_share` of
    their prior's standard deviation; `parameter_odds` are their prior odds against one entry,
    `further_odds` those of each further entry. The cause is rather unknown than not when the best
    hypothesis leaves more than `unknown_left` of what a flexible correction takes. Two names stay
    while their odds are below `odds`.
    """

    quiet_gain: float
    quiet_ratio: float
    channel_ratio: float
    form_share: float
    free_share: float
    parameter_odds: float
    further_odds: float
    unknown_left: float
    odds: float


@cache
def shipped_constants() -> Constants:
    """The constants in the package."""
    source = files("smad.checkup") / "data" / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
