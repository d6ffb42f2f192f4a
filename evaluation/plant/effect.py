"""One thing that can be added to the plant, and what is true of it: where it acts and on what.

`known` effects answer to an entry of the published list of candidates, in another form than the
obvious one. `dev` and `sealed` effects are on no list; a bank holds only one of the two kinds.
Once they have been opened, sealed effects become `dev`, or `spent`: no bank draws those any more,
only the quiz.
"""

from dataclasses import dataclass
from typing import Literal

Kind = Literal["known", "dev", "spent", "sealed"]
Side = Literal["each", "one", "across", "both"]
"""Acts on the spring whose magnitude it is (`one`: banks give it to either, never to both), on the
other one, or on what both share."""

FLOW = "flow_before_pump flow_behind_pump"
FORCE = "force_cell_on_x force_cell_on_y"
TUBE = f"recoverable_strain {FORCE}"
"""Where the nominal model can hold a flow, a force on the tendon, and a force beside one wire."""


@dataclass(frozen=True)
class Effect:
    """One physical effect: `usual` leaves about three floors, `limit` is the largest ever used.

    `place_codes` (docs/places.md) say where the nominal model can hold it, that of its own equation
    first; `on` the states there that its law depends on, the first before all.
    """

    name: str
    kind: Kind
    subsystem: str
    unit: str
    usual: float
    limit: float
    place_codes: str
    on: str
    form: str
    side: Side = "each"

    @property
    def places(self) -> list[str]:
        """Codes of its places."""
        return self.place_codes.split()

    @property
    def states(self) -> list[str]:
        """Names of its states."""
        return self.on.split()
