"""Every number that decides where a change lies and what law is missing there, in one file.

`constants.toml` beside it is written by `python -m evaluation where … --calibrate`.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import msgspec


class Constants(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What decides.

    A law has at most `most_terms` terms, an answer at most `most_places` places. A place is told
    when it gains `place_gain` nats on held-out runs and takes `place_share` of their sum of
    squares, `beside_parameters` where other values of the parameters explain the rest. Places that
    take at least `near` of what the best one takes are told beside it, and a further place is told
    only where these are at most `most_places`. A name is given when its effect takes at least
    `name_share` of what the law of its place takes. A run is played again to tell places apart when
    their laws differ on it by `separation` (d²).
    """

    most_terms: int
    most_places: int
    place_gain: float
    place_share: float
    beside_parameters: float
    near: float
    name_share: float
    separation: float


@cache
def shipped() -> Constants:
    """The constants in the package."""
    source = files("smad.diagnosis") / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
