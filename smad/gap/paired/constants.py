"""The few constants of the decision, from one TOML that a command writes."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec


class Constants(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Limits in white space, where a row without a change has variance 1.

    A bench has changed when the best entry takes more than `quiet_gain` off the sum of squares, or
    the mean square of all rows exceeds `quiet_ratio`, or that of one channel `channel_ratio`.
    Scores are tempered by `temper`, and by `form_share` squared of what the best takes, since an
    entry's law has another form than the bench's. Two names stay while their odds are below `odds`.
    A further name must take more than `further_gain` where `further_form` of what the names before
    change is added to the floor. The cause is unknown when more than `unknown_left` is left of what
    a flexible correction takes.
    """

    quiet_gain: float
    quiet_ratio: float
    channel_ratio: float
    form_share: float
    further_form: float
    further_gain: float
    temper: float
    odds: float
    unknown_left: float


@cache
def shipped_constants() -> Constants:
    """The constants in the package."""
    source = files("smad.gap.paired") / "data" / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
