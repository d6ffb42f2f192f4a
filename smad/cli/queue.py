"""`smad queue`: commands that run one after the other, also when nobody is there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.options import (
    FOLDER,
    Group,
    argument,
    bench_option,
    flag,
    json_option,
    option,
    together,
)
from smad.cli.output import print_json
from smad.cli.quantity import Quantity, Whole
from smad.counted import counted
from smad.view.terminal.progress import note
from smad.view.terminal.tables import print_columns

if TYPE_CHECKING:
    from smad.queue import Queue

_ANYTHING = {"ignore_unknown_options": True, "allow_interspersed_args": False}


@dataclass(frozen=True, kw_only=True)
class _Place:
    """The queue that a command is for."""

    bench: str = bench_option
    folder: Path | None = option(
        "--folder",
        "Folder of the queue  [default: that of the daemon's run logs, else runs]",
        FOLDER,
        envvar="SMAD_QUEUE",
    )

    def open(self) -> Queue:
        """Open it, for as long as the command runs."""
        from smad.queue import Queue

        return Queue(self.folder, bench=self.bench)


_queue = together(_Place)
_number = argument(Whole(1), metavar="ITEM")


@click.group(cls=Group)
def queue() -> None:
    """Queue commands; the queue survives kills and power losses.

    `smad queue run` runs it once a person has armed it with `smad queue resume`. An interrupted
    item never runs again by itself.
    """


@queue.command(context_settings=_ANYTHING)
def add(
    *,
    kind: str = argument(metavar="run|tune|checkup|move"),
    words: tuple[str, ...] = argument(click.UNPROCESSED, nargs=-1),
    repeat: int = option("--repeat", "How many copies to add.", Whole(1, 1000), default=1),
    as_json: bool = json_option,
    opened: Queue = _queue,
) -> None:
    """Add a command to the queue.

    WORDS are what follows `smad run`, `tune`, `gap checkup` or `run moves`. Options of `add` come
    before the kind; --repeat may also come last. The command is checked now, and again when it
    begins.
    """
    from smad.cli.queue_items import items_of, without_repeat

    words, repeat = without_repeat(words, repeat)
    items = items_of(kind, words, Path.cwd(), repeat)
    added = opened.add_checked(items)
    running = opened.snapshot().mode == "running"
    if as_json:
        print_json(added, indent=-1)
        return
    for item in added:
        click.echo(f"item {item.id}: {item.title}")
    if running:
        click.echo(
            "the queue was armed before this item was added; it will pause when it reaches "
            "the item",
            err=True,
        )


@queue.command("list")
def list_items(
    *,
    everything: bool = flag("--all", "Include ended items."),
    as_json: bool = json_option,
    opened: Queue = _queue,
) -> None:
    """Show the items and the state of the queue."""
    from smad.queue.words import ITEMS, item_rows, state_in_words

    snapshot, runner = opened.snapshot(), opened.has_runner
    logs = {item.id: opened.store.logs(item.id) for item in snapshot.items}
    if as_json:
        import msgspec

        print_json({**msgspec.to_builtins(snapshot), "runner": runner, "logs": logs}, indent=-1)
        return
    if rows := item_rows(snapshot, everything=everything):
        print_columns(ITEMS, rows)
    click.echo(state_in_words(snapshot, runner=runner))


@queue.command()
def move(*, number: int = _number, place: int = argument(Whole(1)), opened: Queue = _queue) -> None:
    """Move a queued ITEM to PLACE among those that wait."""
    opened.move(number, place)
    click.echo(f"item {number} is now number {place} of the waiting items")


@queue.command()
def remove(*, number: int = _number, opened: Queue = _queue) -> None:
    """Remove a queued ITEM."""
    opened.remove(number)
    click.echo(f"item {number} removed")


@queue.command()
def again(*, number: int = _number, opened: Queue = _queue) -> None:
    """Add an ended or interrupted ITEM again."""
    item = opened.again(number)
    click.echo(f"item {item.id}: {item.title}")


@queue.command()
def pause(
    *,
    now: bool = flag("--now", "End the running item: it disarms and keeps its log."),
    opened: Queue = _queue,
) -> None:
    """Begin no further item, and disarm what the queue has armed."""
    running = opened.pause(now=now).after.running
    ends = "is being ended" if now else "goes on to its end"
    click.echo("paused" + (f"; item {running.id} {ends}" if running else ""))


@queue.command()
def resume(
    *,
    until: str | None = option("--until HH:MM", "End time, such as 07:30 or 2026-11-26T07:30."),
    hours: float | None = option("--hours", "Longest time.", Quantity("h", 0.0, 744.0, above=True)),
    energy_kJ: float | None = option(
        "--energy-kJ", "Largest heating energy.", Quantity("kJ", 0.0, above=True)
    ),
    cycles: float | None = option(
        "--cycles", "Largest number of cycles.", Quantity(low=0.0, above=True)
    ),
    code: str | None = option("--confirm CODE", "Second step, with the code of the first."),
    opened: Queue = _queue,
) -> None:
    """Arm the queue, in two steps.

    The first step shows what would run and until when; the second is --confirm CODE. Give --until,
    --hours, or both: whichever comes first ends the running item and pauses the queue.
    """
    from smad.queue.arming import CONFIRM_WITHIN_S, earliest_end
    from smad.queue.queue import now_zoned
    from smad.queue.states import Budget
    from smad.queue.words import ITEMS, item_rows, limits_in_words, state_in_words

    if code is not None:
        if (until, hours, energy_kJ, cycles) != (None,) * 4:
            raise click.UsageError("--confirm is given alone: it confirms what was shown")
        snapshot = opened.confirm(code)
        click.echo(state_in_words(snapshot, runner=opened.has_runner))
        return
    if until is None and hours is None:
        raise click.UsageError("give an end: --until 07:30, or --hours 8")
    budget = Budget(
        energy_J=None if energy_kJ is None else energy_kJ * 1e3, cycles=cycles, hours=hours
    )
    proposal = opened.propose(earliest_end(until, hours, now_zoned()), budget)
    print_columns(ITEMS, item_rows(opened.snapshot(), everything=False))
    click.echo(
        f"{counted(len(proposal.arming.items), 'item')} until {limits_in_words(proposal.arming)}"
    )
    click.echo(
        f"to arm them: smad queue resume --confirm {proposal.code}  "
        f"(within {CONFIRM_WITHIN_S:.0f} s)"
    )


@queue.command()
def run(
    *,
    until_paused: bool = flag("--until-paused", "End when the queue pauses, for scripts."),
    opened: Queue = _queue,
) -> None:
    """Run the items of the queue until ctrl-C. A queue has one runner.

    After a kill or a restart, the item that ran is marked interrupted and its run log is recovered.
    The queue then stays paused until a person resumes it.
    """
    from smad.cli.queue_items import obstacle_of
    from smad.client.signals import ended_by_signals
    from smad.queue.runner import run_queue

    with ended_by_signals():
        run_queue(opened, check=obstacle_of, say=note, until_paused=until_paused)


@queue.command()
def messages(
    *,
    after: int = option("--after", "Only messages with a higher number.", Whole(0), default=0),
    as_json: bool = json_option,
    opened: Queue = _queue,
) -> None:
    """List how every item ended and why the queue paused."""
    from smad.queue.words import clock

    listed = opened.messages(after)
    if as_json:
        print_json(listed, indent=-1)
        return
    for message in listed:
        click.echo(f"{message.id:>4}  {clock(message.unix_s)}  {message.text}")
