"""`smad hooks`: word of what happens on a bench, and the relay of its heaters' supply."""

from pathlib import Path

import click

from smad.cli.options import FOLDER, Group, argument, bench_option, flag, option
from smad.view.terminal.progress import note


@click.group(cls=Group)
def hooks() -> None:
    """Run commands on faults, stops, lost links and a full disk.

    They also run at the end of the queue. The section [hooks] of the daemon's configuration names
    them (smad docs guide/queue).
    """


@hooks.command()
def run(
    *,
    bench: str = bench_option,
    folder: Path | None = option(
        "--folder",
        "Folder of the queue  [default: that of the daemon's run logs]",
        FOLDER,
        envvar="SMAD_QUEUE",
    ),
) -> None:
    """Watch bench and queue until ctrl-C, and run the hooks.

    It first reports the events since its last run.
    """
    from smad.client.signals import ended_by_signals
    from smad.hooks.watch import watch

    with ended_by_signals():
        watch(bench, folder, note)


@hooks.command("test")
def run_once(*, name: str = argument(metavar="HOOK"), bench: str = bench_option) -> None:
    """Run one HOOK with a made-up event, and wait for its end."""
    from smad.hooks.watch import try_hook

    try_hook(name, bench, note)


@hooks.command(context_settings={"ignore_unknown_options": True})
def relay(
    *,
    tasmota: str | None = option(
        "--tasmota URL", "A plug with Tasmota's firmware: http://plug.lab"
    ),
    holding: bool = flag("--while", "COMMAND keeps the relay on while it runs, such as gpioset."),
    command: tuple[str, ...] = argument(click.UNPROCESSED, nargs=-1),
    bench: str = bench_option,
) -> None:
    """Keep the heaters' supply on while samples arrive.

    The relay opens when samples end, in FAULT or ESTOP, and when this command ends. SIGKILL ends
    COMMAND, but not what it started: do not give a shell. Only a person closes the relay again.
    """
    from smad.client.signals import ended_by_signals
    from smad.hooks.relay import HoldingRelay, Relay, TasmotaRelay, hold

    if (tasmota is None) == (not holding) or holding != bool(command):
        raise click.UsageError("give --tasmota URL, or --while COMMAND…")
    device: Relay = HoldingRelay(command) if tasmota is None else TasmotaRelay(tasmota)
    with ended_by_signals():
        hold(device, bench, note)
