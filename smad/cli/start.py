"""`smad start`: the daemon, on a board or on a simulated bench."""

import contextlib
import dataclasses
import functools
from pathlib import Path

import click

from smad.cli.options import PATH, Command, config_option, flag, option, together
from smad.cli.quantity import Whole
from smad.cli.simulated import Boards, rate_option
from smad.errors import ConfigError
from smad.view.terminal.progress import progress


@click.command(cls=Command)
def start(
    *,
    port: str | None = option(
        "--port", "Without --sim: serial device of the board, preferably /dev/serial/by-id/…."
    ),
    simulated: bool = flag("--sim", "Start a simulated bench and use it."),
    path: Path | None = config_option,
    bench: str | None = option("--bench", "Name of the bench, if there are several."),
    baud: int | None = option("--baud", "Without --sim: bits per second of the line.", Whole(1)),
    without_missing: bool = flag("--without-missing", "Start even if some boards are missing."),
    rate: str | None = rate_option,
    boards: Boards = together(Boards, "With --sim: "),
    fd: str | None = option(
        "--fd", "Inherited sockets instead of ports: N,… by axis.", hidden=True
    ),
    trace_path: Path | None = option("--trace", type=PATH, hidden=True),
    no_realtime: bool = flag("--no-realtime", "Do not ask for real-time measures."),
) -> int:
    """Run the daemon until ctrl-C, which disarms.

    Clients then command it: smad status, smad arm, smad move …, or smad.Client in Python.
    """
    from smad.config import load_config, with_changes, without_realtime
    from smad.daemon.lifecycle import run
    from smad.daemon.link.openers import serial_openers, socket_openers
    from smad.daemon.process import Options
    from smad.daemon.trace import Trace
    from smad.processes.simulator import simulated_board

    config = boards.configured(path, rate)
    config = with_changes(config, link={"baud": baud}, daemon={"bench": bench})
    if no_realtime:
        config = without_realtime(config)
    options = Options(
        reread=None if path is None else functools.partial(load_config, path, again=True),
        check_baud=fd is None,
        trace=None if trace_path is None else Trace(trace_path),
        patience=boards.patience,
        without_missing=without_missing,
    )
    with contextlib.ExitStack() as stack:
        if simulated:
            line = stack.enter_context(progress())
            board = simulated_board(
                config,
                path,
                faults=boards.faults,
                firmware=boards.firmware,
                patience=boards.patience if boards.paced_by_host else None,
                waiting=line.say,
            )
            config, parameter_text = stack.enter_context(board)
            options = dataclasses.replace(options, parameter_text=parameter_text)
            line.done()
        elif port is not None:
            if config.axes:
                cause, action = "--port is for a bench of one axis", "set the ports in [[axes]]"
                raise ConfigError(cause, value=port, action=action)
            config = with_changes(config, link={"port": port})
        sockets = None if simulated else fd
        openers = serial_openers(config) if sockets is None else socket_openers(config, sockets)
        ended = run(config, openers, options)
    click.echo(f"smad: {ended.line}", err=True)
    return ended.status
