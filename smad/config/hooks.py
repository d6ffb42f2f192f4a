"""The section `[hooks]`: commands that are told of what happens."""

from typing import Annotated

from msgspec import Meta

from smad.config.section import Section

Command = tuple[Annotated[str, Meta(min_length=1, max_length=1000)], ...]


class HooksConfig(Section, frozen=True, kw_only=True):
    """Commands that `smad hooks run` begins, with the event as JSON on standard input."""

    on_fault: Annotated[Command, Meta(description="a fault, or a limit of the host")] = ()
    on_stop: Annotated[Command, Meta(description="somebody stopped an armed bench")] = ()
    on_link_lost: Annotated[
        Command, Meta(description="the board or the daemon does not answer any more")
    ] = ()
    on_queue_end: Annotated[
        Command, Meta(description="an item or the queue ended, the queue paused, its runner died")
    ] = ()
    on_disk_low: Annotated[Command, Meta(description="too little room for run logs")] = ()
    timeout_s: Annotated[
        float, Meta(ge=0.1, le=600.0, description="a command is killed after so long")
    ] = 20.0
    disk_low_MB: Annotated[
        float, Meta(ge=0.0, le=100_000_000.0, description="room on the disk of the run logs")
    ] = 2000.0
