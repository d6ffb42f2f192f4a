"""Requests from the page's server to its reader process, and the replies. Types only.

Reading logs and making plans takes seconds of processor time. A click on STOP passes through the
server and must not wait for them, so another process does that work.
"""

from collections.abc import Mapping
from typing import Any

from msgspec import Struct

from smad.config import LimitsConfig
from smad.view.tier import Frame, Moments


class ReaderRequest(Struct, tag_field="do", frozen=True, kw_only=True):
    """Base of the requests to the reader; `do` names the kind."""


class Past(ReaderRequest, tag="past", frozen=True, kw_only=True):
    """Read channels of the run log at `path`, and of its further parts, between two times.

    `axis` is the axis that they belong to; the only axis has no name.
    """

    path: str
    axis: str
    from_s: float
    to_s: float
    channels: tuple[str, ...]
    xy: tuple[str, ...]


class Runs(ReaderRequest, tag="runs", frozen=True, kw_only=True):
    """List the newest run logs of a folder."""

    folder: str
    most: int


class Results(ReaderRequest, tag="results", frozen=True, kw_only=True):
    """Return a table of a run's results, of one axis where it has several."""

    path: str
    axis: str


class Experiments(ReaderRequest, tag="experiments", frozen=True, kw_only=True):
    """Make the forms of the experiments."""


class Plan(ReaderRequest, tag="plan", frozen=True, kw_only=True):
    """Return the curves of the references that an experiment will command."""

    experiment: str
    settings: Mapping[str, Any]
    limits: LimitsConfig
    handover_rate_mm_per_s: float


Request = Past | Runs | Results | Experiments | Plan


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
