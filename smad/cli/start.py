"""`smad start`: the daemon, on a board or on a simulated bench."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from smad.cli.output import PATH, config_option
from smad.cli.quantity import Whole
from smad.cli.simulated import board_options
from smad.errors import ConfigError

if TYPE_CHECKING:
    from smad.config import Config
    from smad.daemon.link.port import Opener
    from smad.daemon.process import Options


@click.command()
@click.option("--port", help="Serial device of the board, preferably /dev/serial/by-id/….")
@click.option("--sim", "simulated", is_flag=True, help="Start a simulated bench and use it.")
@config_option
@click.option("--bench", help="Name of the bench, if there are several.")
@click.option("--baud", type=Whole(1), help="Bits per second of the serial line.")
@click.option("--without-missing", is_flag=True, help="Start even if some boards are missing.")
@board_options("With --sim: ")
@click.option("--fd", hidden=True, help="Inherited sockets instead of ports: N,… by axis.")
@click.option("--trace", "trace_path", type=PATH, hidden=True)
@click.option("--no-realtime", is_flag=True, help="Do not ask for real-time measures.")
def start(
    *,
    port: str | None,
    simulated: bool,
    path: Path | None,
    bench: str | None,
    rate: str | None,
    baud: int | None,
    axes: int | None,
    without_missing: bool,
    speed: float | None,
    seed: int | None,
    paced_by_host: bool,
    faults: tuple[str, ...],
    firmware: str,
    fd: str | None,
    patience: int,
    trace_path: Path | None,
    parent: int | None,
    no_realtime: bool,
) -> int:
    """Run the daemon until ctrl-C, which disarms.

    Clients then command it: smad status, smad arm, smad move …, or smad.Client in Python.
    """
    from smad.config import load_config, replaced
    from smad.daemon.link.openers import serial_openers, socket_openers
    from smad.daemon.process import Options
    from smad.daemon.trace import Trace

    if parent is not None:
        from smad.processes.parent import end_with

        end_with(parent)
    config = _settled(path, bench=bench, rate=rate, baud=baud, no_realtime=no_realtime)
    options = Options(
        reread=None if path is None else functools.partial(load_config, path),
        check_baud=fd is None,
        trace=None if trace_path is None else Trace(trace_path),
        patience=patience,
        without_missing=without_missing,
    )
    if not simulated:
        needs = (speed, seed, axes, paced_by_host or None, faults or None)
        if any(given is not None for given in needs) or firmware != "python":
            raise ConfigError(
                "--speed, --seed, --axes, --paced-by-host, --fault and --firmware need --sim",
                action="add --sim, or leave them out",
            )
        if port is not None:
            if config.axes:
                raise ConfigError(
                    "--port is for a bench of one axis",
                    value=port,
                    action="set the ports in [[axes]]",
                )
            config = replaced(config, "link", port=port)
        return _run(
            config, serial_openers(config) if fd is None else socket_openers(config, fd), options
        )
    for option, given in (("--port", port), ("--baud", baud)):
        if given is not None:
            cause = f"{option} and --sim exclude each other"
            raise ConfigError(cause, value=given, action=f"leave {option} out, or --sim")
    from smad.cli.output import progress
    from smad.processes.simulated_board import simulated_board

    plant = {"seed": seed, "speed_ratio": speed}
    config = replaced(config, "plant", **{k: v for k, v in plant.items() if v is not None})
    words = [word for text in faults for word in ("--fault", text)]
    words += [] if path is None else ["--config", str(path)]
    words += ["--paced-by-host", "--patience", str(patience)] if paced_by_host else []
    with (
        progress() as line,
        simulated_board(
            config.with_axes(axes),
            words,
            firmware=firmware,
            paced_by_host=paced_by_host,
            waiting=line.say,
        ) as (config, parameter_text),
    ):
        line.done()
        return _run(
            config,
            serial_openers(config),
            dataclasses.replace(options, parameter_text=parameter_text),
        )


def _settled(
    path: Path | None, *, bench: str | None, rate: str | None, baud: int | None, no_realtime: bool
) -> Config:
    """The configuration of the file, with what the options change in it. Raises ConfigError."""
    from smad.config import Config, load_config, replaced, without_realtime

    config = Config() if path is None else load_config(path)
    if rate is not None:
        config = replaced(config, "link", rate_hz=int(rate))
    if baud is not None:
        config = replaced(config, "link", baud=baud)
    if bench is not None:
        config = replaced(config, "daemon", bench=bench)
    return without_realtime(config) if no_realtime else config


def _run(config: Config, openers: Mapping[str, Opener], options: Options) -> int:
    from smad.daemon.lifecycle import run

    ended = run(config, openers, options)
    click.echo(f"smad: {ended.line}", err=True)
    return ended.status
