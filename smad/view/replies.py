"""What the page's server gets from its reader process. Types only."""

from msgspec import Struct

from smad.view.tier import Frame, Moments


class Mark(Struct, frozen=True):
    """A line across the strips: `x`, when, and what happened."""

    x: float
    text: str


class Read(Struct, frozen=True, kw_only=True):
    """The content of a run log between two times; `first_s`, `last_s` bound the whole log."""

    frame: Frame
    moments: Moments | None
    marks: tuple[Mark, ...]
    first_s: float
    last_s: float


class Preview(Struct, frozen=True, kw_only=True):
    """The reference over time as a command or a run will ask for it, and what to say of it.

    `t_s` and `mm` of one length, `mm` None where nothing is followed; `refused` says that the
    daemon will not take it.
    """

    title: str
    t_s: list[float]
    mm: list[float | None]
    words: str
    refused: bool = False
