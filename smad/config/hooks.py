"""The section `[hooks]`: commands that run when something happens."""

from typing import Annotated

from msgspec import Meta

from smad.config.section import Section, about, between

Command = tuple[Annotated[str, Meta(min_length=1, max_length=1000)], ...]


class HooksConfig(Section, frozen=True, kw_only=True):
    """Commands that `smad hooks run` starts, with the event as JSON on standard input."""

    on_fault: Annotated[Command, about("a fault, or a limit of the host")] = ()
    on_stop: Annotated[Command, about("somebody stopped an armed bench")] = ()
    on_link_lost: Annotated[Command, about("the board or the daemon does not answer any more")] = ()
    on_queue_end: Annotated[
        Command, about("an item or the queue ended, the queue paused, its runner died")
    ] = ()
    on_disk_low: Annotated[Command, about("too little room for run logs")] = ()
    timeout_s: Annotated[float, between(0.1, 600.0, "a command is killed after so long")] = 20.0
    disk_low_MB: Annotated[
        float, between(0.0, 100_000_000.0, "room on the disk of the run logs")
    ] = 2000.0
