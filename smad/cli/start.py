"""`smad start`: the daemon, on a board or on a simulated bench."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import msgspec

from smad.cli.output import PATH
from smad.errors import ConfigError

if TYPE_CHECKING:
    from smad.config import Config

SIMULATED_BAUDS = {"python": 921_600, "host": 921_600, "avr": 500_000}
"""What the simulated board says it has; a pseudo-terminal takes any."""


@click.command()
@click.option("--port", help="Serial device of the board, best /dev/serial/by-id/….")
@click.option("--sim", "simulated", is_flag=True, help="Start a simulated bench and use it.")
@click.option(
    "--config",
    "path",
    type=PATH,
    envvar="SMAD_CONFIG",
    help="Configuration file (smad config show).",
)
@click.option("--bench", help="Name of the bench, where there are several.")
@click.option("--rate", type=click.Choice(["100", "250", "500"]), help="Samples per second.")
@click.option("--baud", type=int, help="Bits per second of the serial line.")
@click.option("--axes", type=click.IntRange(1, 6), help="With --sim: number of boards.")
@click.option("--without-missing", is_flag=True, help="Start even if some boards are missing.")
@click.option("--speed", type=float, help="With --sim: board time over wall time.")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), help="With --sim: seed of all noise.")
@click.option(
    "--paced-by-host", is_flag=True, help="With --sim: the board waits for each setpoint."
)
@click.option(
    "--fault", "faults", multiple=True, help="With --sim: a fault to inject; see smad sim --help."
)
@click.option(
    "--firmware",
    type=click.Choice(["python", "host", "avr"]),
    default="python",
    help="With --sim: the board, see smad sim --help.",
)
@click.option("--fd", hidden=True, help="Inherited sockets instead of ports: N,… by axis.")
@click.option(
    "--patience",
    type=click.IntRange(1, 1000),
    default=1,
    hidden=True,
    help="With --paced-by-host: both ends wait so many times as long for each other.",
)
@click.option("--trace", "trace_path", type=PATH, hidden=True)
@click.option("--parent", type=int, hidden=True, help="End when this process does.")
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
    from smad.config import load_config

    if parent is not None:
        from smad.processes.parent import end_with

        end_with(parent)
    config = _settled(path, bench=bench, rate=rate, baud=baud)
    if no_realtime:
        config = without_realtime(config)
    reread = None if path is None else functools.partial(load_config, path)
    if not simulated:
        needs = (speed, seed, axes, paced_by_host or None, faults or None)
        if any(given is not None for given in needs) or firmware != "python":
            raise ConfigError(
                "--speed, --seed, --axes, --paced-by-host, --fault and --firmware need --sim",
                action="add --sim, or leave them out",
            )
        options = {"trace_path": trace_path, "fd": fd, "without_missing": without_missing}
        return _on_board(config, port, reread, options)
    if port is not None:
        raise ConfigError(
            "--port and --sim exclude each other",
            value=port,
            action="choose the board or the simulated bench",
        )
    if baud is not None:
        raise ConfigError(
            "--baud and --sim exclude each other: a pseudo-terminal takes any",
            value=baud,
            action="leave --baud out",
        )
    plant = config.plant
    config = replaced(
        config,
        "plant",
        seed=plant.seed if seed is None else seed,
        speed_ratio=plant.speed_ratio if speed is None else speed,
    )
    return _on_simulation(
        config.with_axes(axes),
        path,
        reread,
        paced_by_host=paced_by_host,
        patience=patience,
        faults=faults,
        firmware=firmware,
    )


def replaced(config: Config, section: str, **values: object) -> Config:
    """Return the configuration with keys of one section changed. Raises ConfigError."""
    from smad.config import config_to_toml, parse_config

    changed = msgspec.structs.replace(getattr(config, section), **values)
    # Through the text and back, so that what comes from options is checked like a file.
    return parse_config(
        config_to_toml(msgspec.structs.replace(config, **{section: changed})), source="options"
    )


def without_realtime(config: Config) -> Config:
    """Return the configuration with no real-time measure asked for."""
    return replaced(config, "realtime", fifo_priority=0, lock_memory=False, freeze_gc=False)


def _settled(path: Path | None, *, bench: str | None, rate: str | None, baud: int | None) -> Config:
    from smad.config import Config, load_config

    config = Config() if path is None else load_config(path)
    if rate is not None:
        config = replaced(config, "link", rate_hz=int(rate))
    if baud is not None:
        config = replaced(config, "link", baud=baud)
    if bench is not None:
        config = replaced(config, "daemon", bench=bench)
    return config


def _on_board(
    config: Config,
    port: str | None,
    reread: Callable[[], Config] | None,
    options: Mapping[str, Any],
) -> int:
    if port is not None:
        if config.axes:
            raise ConfigError(
                "--port is for a bench of one axis", value=port, action="set the ports in [[axes]]"
            )
        config = replaced(config, "link", port=port)
    for name, axis_config in config.by_axis().items():
        if options["fd"] is None and not axis_config.link.port:
            raise ConfigError(
                f"no port is named{f' for the axis {name}' if name else ''}",
                limit="--port DEVICE, or link.port in the configuration"
                if not name
                else "port in its [[axes]]",
                action="look in /dev/serial/by-id, or try smad start --sim",
            )
    _require_ports_apart(config)
    return _run(config, None, reread, **options)


def _require_ports_apart(config: Config) -> None:
    """Raise ConfigError when two axes name one device, whatever they call it."""
    seen: dict[str, str] = {}
    for name, axis_config in config.by_axis().items():
        real = os.path.realpath(axis_config.link.port)
        if real in seen:
            raise ConfigError(
                f"the axes {seen[real]} and {name} are on one port",
                value=f"{axis_config.link.port} is {real}",
                limit="one axis a port, as a board drives one",
                action="give each axis the port of its own board",
            )
        seen[real] = name


def _on_simulation(
    config: Config,
    path: Path | None,
    reread: Callable[[], Config] | None,
    *,
    paced_by_host: bool,
    patience: int,
    faults: tuple[str, ...],
    firmware: str,
) -> int:
    from smad.cli.output import progress
    from smad.client.endpoints import default_folder, prepare_folder
    from smad.processes.simulator import simulated_bench

    # Before the bench is started: it would wait for ever for a file that is a pipe.
    parameter_text = _parameter_text(config)
    folder = Path(config.daemon.ipc_dir or default_folder()).absolute()
    prepare_folder(folder)
    arguments = ["--seed", str(config.plant.seed), "--rate", str(config.link.rate_hz)]
    arguments += ["--speed", str(config.plant.speed_ratio)]
    arguments += ["--firmware", firmware]
    arguments += [] if path is None else ["--config", str(path)]
    arguments += ["--paced-by-host", "--patience", str(patience)] if paced_by_host else []
    arguments += [word for text in faults for word in ("--fault", text)]
    if config.plant.speed_ratio != 1.0 or paced_by_host:
        # Time that is not the wall's needs no priority; a loop that never sleeps would take a core.
        config = replaced(config, "realtime", fifo_priority=0)
    arguments += [] if not config.axes else ["--axes", str(len(config.axes))]
    symlink = folder / f"{config.daemon.bench}.tty"
    with progress() as line, simulated_bench(arguments, symlink, waiting=line.say) as port:
        line.done()
        config = replaced(config, "link", port=port, baud=SIMULATED_BAUDS[firmware])
        placed = [msgspec.structs.replace(a, port=f"{port}.{a.name}") for a in config.axes]
        config = msgspec.structs.replace(config, axes=tuple(placed))
        return _run(config, parameter_text, reread, patience=patience)


def _parameter_text(config: Config) -> str:
    from importlib import resources

    if config.plant.parameter_file:
        path = Path(config.plant.parameter_file)
        if path.exists() and not path.is_file():
            raise ConfigError(
                "plant.parameter_file is no file", value=str(path), action="name a TOML file"
            )
        return path.read_text()
    return (resources.files("sim_device") / "plant" / "data" / "set_a.toml").read_text()


def _run(
    config: Config,
    parameter_text: str | None,
    reread: Callable[[], Config] | None,
    *,
    trace_path: Path | None = None,
    fd: str | None = None,
    patience: int = 1,
    without_missing: bool = False,
) -> int:
    from smad.daemon.lifecycle import run
    from smad.daemon.link.port import Opener, PortFinder, SocketTransport, Transport, open_serial
    from smad.daemon.process import Options
    from smad.daemon.trace import Trace

    def opener(axis_config: Config) -> Opener:
        finder = PortFinder(axis_config.link.port)

        def open_port() -> Transport:
            path = finder.find()
            transport = open_serial(path, axis_config.link.baud)
            finder.remember(path)
            return transport

        return open_port

    def socket_opener(number: int) -> Opener:
        import socket

        return lambda: SocketTransport(socket.socket(fileno=number))

    axes = config.by_axis()
    ended = run(
        config,
        {name: opener(axis_config) for name, axis_config in axes.items()}
        if fd is None
        else {
            name: socket_opener(int(number))
            for name, number in zip(axes, fd.split(","), strict=True)
        },
        Options(
            parameter_text=parameter_text,
            reread=reread,
            check_baud=fd is None,
            trace=None if trace_path is None else Trace(trace_path),
            patience=patience,
            without_missing=without_missing,
        ),
    )
    click.echo(f"smad: {ended.line}", err=True)
    return ended.status
