"""`smad queue`: commands that run one after the other, also when nobody is there."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from smad.cli.output import FOLDER, bench_option, json_option, print_json
from smad.cli.quantity import Quantity, Whole
from smad.counted import counted

if TYPE_CHECKING:
    from smad.queue import Queue
    from smad.queue.states import Snapshot

_ANYTHING = {"ignore_unknown_options": True, "allow_interspersed_args": False}

_folder_option = click.option(
    "--folder",
    type=FOLDER,
    envvar="SMAD_QUEUE",
    help="Folder of the queue  [default: that of the daemon's run logs, else runs]",
)
_number = click.argument("number", type=Whole(1), metavar="ITEM")


def _on_queue(command: Callable[..., None]) -> Callable[..., None]:
    """Add `--bench` and `--folder`; the command gets the queue they name as `opened`."""

    @functools.wraps(command)
    def open_queue(*, folder: Path | None, bench: str, **typed: Any) -> None:
        from smad.queue import Queue

        with Queue(folder, bench=bench) as opened:
            command(opened=opened, **typed)

    return bench_option(_folder_option(open_queue))


@click.group()
def queue() -> None:
    """Queue commands; the queue survives kills and power losses.

    `smad queue run` runs it once a person has armed it with `smad queue resume`. An interrupted
    item never runs again by itself.
    """


@queue.command(context_settings=_ANYTHING)
@click.argument("kind", metavar="run|tune|checkup|move")
@click.argument("words", nargs=-1, type=click.UNPROCESSED)
@click.option("--repeat", type=Whole(1, 1000), default=1, help="How many copies to add.")
@json_option
@_on_queue
def add(
    *,
    kind: str,
    words: tuple[str, ...],
    repeat: int,
    as_json: bool,
    opened: Queue,
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
@click.option("--all", "everything", is_flag=True, help="Include ended items.")
@json_option
@_on_queue
def list_items(*, everything: bool, as_json: bool, opened: Queue) -> None:
    """Show the items and the state of the queue."""
    from smad.queue.words import state_in_words

    snapshot, runner = opened.snapshot(), opened.has_runner
    logs = {item.id: opened.store.logs(item.id) for item in snapshot.items}
    if as_json:
        import msgspec

        print_json({**msgspec.to_builtins(snapshot), "runner": runner, "logs": logs}, indent=-1)
        return
    _print_items(snapshot, everything=everything)
    click.echo(state_in_words(snapshot, runner=runner))


def _print_items(snapshot: Snapshot, *, everything: bool) -> None:
    from smad.cli.tables import print_table
    from smad.queue.words import clock
    from smad.report.page import Table

    ended = [item for item in snapshot.items if item.ended_unix_s]
    shown = [*ended, *([snapshot.running] if snapshot.running else []), *snapshot.queued]
    if not everything:
        shown = shown[max(0, len(ended) - 5) :]
    rows = [
        (
            str(item.id),
            item.title,
            item.state,
            clock(item.started_unix_s or item.added_unix_s),
            item.reason,
        )
        for item in shown
    ]
    if rows:
        print_table(Table(("item", "command", "state", "since", "why"), rows))


@queue.command()
@_number
@click.argument("place", type=Whole(1))
@_on_queue
def move(*, number: int, place: int, opened: Queue) -> None:
    """Move a queued ITEM to PLACE among those that wait."""
    opened.move(number, place)
    click.echo(f"item {number} is now number {place} of the waiting items")


@queue.command()
@_number
@_on_queue
def remove(*, number: int, opened: Queue) -> None:
    """Remove a queued ITEM."""
    opened.remove(number)
    click.echo(f"item {number} removed")


@queue.command()
@_number
@_on_queue
def again(*, number: int, opened: Queue) -> None:
    """Add an ended or interrupted ITEM again."""
    item = opened.again(number)
    click.echo(f"item {item.id}: {item.title}")


@queue.command()
@click.option("--now", is_flag=True, help="End the running item: it disarms and keeps its log.")
@_on_queue
def pause(*, now: bool, opened: Queue) -> None:
    """Begin no further item, and end the arming."""
    running = opened.pause(now=now).after.running
    ends = "is being ended" if now else "goes on to its end"
    click.echo("paused" + (f"; item {running.id} {ends}" if running else ""))


@queue.command()
@click.option("--until", metavar="HH:MM", help="End time, such as 07:30 or 2026-11-26T07:30.")
@click.option("--hours", type=Quantity("h", 0.0, 744.0, above=True), help="Longest time.")
@click.option(
    "--energy-kJ",
    "energy_kJ",
    type=Quantity("kJ", 0.0, above=True),
    help="Largest heating energy.",
)
@click.option("--cycles", type=Quantity(low=0.0, above=True), help="Largest number of cycles.")
@click.option("--confirm", "code", metavar="CODE", help="Second step, with the code of the first.")
@_on_queue
def resume(
    *,
    until: str | None,
    hours: float | None,
    energy_kJ: float | None,
    cycles: float | None,
    code: str | None,
    opened: Queue,
) -> None:
    """Arm the queue, in two steps.

    The first step shows what would run and until when; the second is --confirm CODE. Give --until,
    --hours, or both: whichever comes first ends the running item and pauses the queue.
    """
    from smad.queue.arming import CONFIRM_WITHIN_S, end_time
    from smad.queue.queue import now_zoned
    from smad.queue.states import Budget
    from smad.queue.words import limits_in_words, state_in_words

    if code is not None:
        if (until, hours, energy_kJ, cycles) != (None,) * 4:
            raise click.UsageError("--confirm is given alone: it confirms what was shown")
        snapshot = opened.confirm(code)
        click.echo(state_in_words(snapshot, runner=opened.has_runner))
        return
    if until is None and hours is None:
        raise click.UsageError("give an end: --until 07:30, or --hours 8")
    now = now_zoned()
    ends = [] if until is None else [end_time(until, now).timestamp()]
    if hours is not None:
        ends.append(now.timestamp() + hours * 3600.0)
    budget = Budget(
        energy_J=None if energy_kJ is None else energy_kJ * 1e3, cycles=cycles, hours=hours
    )
    proposal = opened.propose(min(ends), budget)
    _print_items(opened.snapshot(), everything=False)
    click.echo(
        f"{counted(len(proposal.arming.items), 'item')} until {limits_in_words(proposal.arming)}"
    )
    click.echo(
        f"to arm them: smad queue resume --confirm {proposal.code}  "
        f"(within {CONFIRM_WITHIN_S:.0f} s)"
    )


@queue.command()
@click.option("--until-paused", is_flag=True, help="End when the queue pauses, for scripts.")
@_on_queue
def run(*, until_paused: bool, opened: Queue) -> None:
    """Run the items of the queue until ctrl-C. A queue has one runner.

    After a kill or a restart the item that ran is interrupted, its run log is recovered, and the
    queue is paused until a person resumes it.
    """
    from smad.cli.queue_items import obstacle_of
    from smad.client.signals import ended_by_signals
    from smad.queue.running import run_queue

    with ended_by_signals():
        run_queue(opened, check=obstacle_of, say=_say, until_paused=until_paused)


@queue.command()
@click.option("--after", type=Whole(0), default=0, help="Only messages with a higher number.")
@json_option
@_on_queue
def messages(*, after: int, as_json: bool, opened: Queue) -> None:
    """List how every item ended and why the queue paused."""
    from smad.queue.words import clock

    listed = opened.messages(after)
    if as_json:
        print_json(listed, indent=-1)
        return
    for message in listed:
        click.echo(f"{message.id:>4}  {clock(message.unix_s)}  {message.text}")


def _say(text: str) -> None:
    from smad.queue.words import clock

    click.echo(f"{clock(time.time())}  {text}", err=True)
