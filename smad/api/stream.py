"""The published samples, and under which topic."""

from typing import Annotated

from msgspec import Meta

from smad.runlog.schema import Row

TELEMETRY_TOPIC = "smad"
AXIS_TOPICS = "axis/"
"""Topic of the samples of a bench of one axis; what the topics of several begin with."""


def topic_of(axis: str) -> str:
    """Return the topic of the samples of an axis; of the only one, which has no name, too."""
    return f"{AXIS_TOPICS}{axis}" if axis else TELEMETRY_TOPIC


class Telemetry(Row, kw_only=True, omit_defaults=False):
    """One published sample: a row of the run log with its time and number.

    The stream has two frames a message: the topic `smad` and this, as JSON.
    """

    timestamp: Annotated[
        float,
        Meta(description="Unix time of the sample in s: board time, steered to the host's clock"),
    ]
    sequence: Annotated[int, Meta(description="counts published samples; a gap is a loss")]
