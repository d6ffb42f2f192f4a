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
    `most_places` places, a list of *differs* at most `most_listed`. Places that take at least
    `near` of what the best one takes are told beside it. A name is given when its effect takes at
    least `name_share` of what the law of its place takes.

    Check-ups: a place is told when it gains `place_gain` nats on held-out runs and takes
    `place_share` of their sum of squares, `beside_parameters` where other values of the parameters
    explain the rest, and a further place only where those near it are at most `most_places`. A run
    is played again to tell places apart when their laws differ on it by `separation` (d²).

    Differs: a place is sought while it gains `list_gain` nats, and stays in the list when it takes
    `place_share` of what the parameters leave, in the simulator. A gap below `quiet_floors` floors
    is none.

    Changed: a place, or other values of the parameters, are new when they add `changed_share` of
    the rows in question, a further place when it adds `further_share`, and
    runs of one kind would differ so with probability `chance` at most; beside other values of the
    parameters that take as much, a place must add `beside_parameters` of what they leave. A run is not of one state
    with the others when coefficients of its own take `apart_share` of its rows.
    """

    most_terms: int
    most_places: int
    most_listed: int
    near: float
    name_share: float
    place_gain: float
    place_share: float
    beside_parameters: float
    separation: float
    list_gain: float
    quiet_floors: float
    changed_share: float
    further_share: float
    chance: float
    apart_share: float


@cache
def shipped() -> Constants:
    """The constants in the package."""
    source = files("smad.diagnosis") / "constants.toml"
    return msgspec.toml.decode(source.read_bytes(), type=Constants)
