"""`smad sim`: the simulated bench alone, behind a pseudo-terminal."""

from collections.abc import Mapping
from pathlib import Path

import click
import msgspec

from smad.cli.output import FILE, PATH, config_option
from smad.cli.quantity import Quantity
from smad.cli.simulated import board_options, effect_lines, effects_option
from smad.cli.tables import print_columns
from smad.processes.boards import SimulatedBenchError, build, built
from smad.processes.simulator import READY


@click.command()
@config_option
@click.option("--symlink", type=PATH, help="A lasting name for the port.")
@click.option(
    "--model",
    "model_path",
    type=PATH,
    help="Model file of smad gap diagnose --apply, in place of the configured plant.",
)
@effects_option("An effect that the bench has (smad gap effects); typical strength without values.")
@board_options("")
@click.option(
    "--store",
    "store_path",
    type=FILE,
    help="With --firmware: file that keeps the board's parameter memory.",
)
@click.option(
    "--for", "seconds", type=Quantity("s", 0.0, 1e9), metavar="S", help="End after this time."
)
@click.option("--transport", default="pty", help="pty, or fd:N,… (sockets).")
def sim(
    *,
    path: Path | None,
    speed: float | None,
    rate: str | None,
    seed: int | None,
    symlink: Path | None,
    model_path: Path | None,
    effects: tuple[str, ...],
    axes: int | None,
    paced_by_host: bool,
    faults: tuple[str, ...],
    firmware: str,
    store_path: Path | None,
    seconds: float | None,
    transport: str,
    patience: int,
    parent: int | None,
) -> None:
    """Run the simulated bench alone, without a daemon.

    It prints the name of its port. Each of several axes has a port, and a fault is then
    --fault AXIS:FAULT. Ctrl-C ends the bench.
    """
    from sim_device.errors import BenchError
    from sim_device.plant.errors import PlantError
    from sim_device.pty import HOST_TIMEOUT_S, said_of_host, serve
    from smad.config import Config, load_config

    if "list" in faults:
        from sim_device.faults import fault_rows

        print_columns(("fault", "group", "what happens", "parameters"), fault_rows())
        return
    if parent is not None:
        from smad.processes.parent import end_with

        # A daemon that is killed must not leave a bench behind that nobody knows how to end.
        end_with(parent)
    config = (Config() if path is None else load_config(path)).with_axes(axes)
    if rate is not None:
        # What an axis has of its own stands.
        link = msgspec.structs.replace(config.link, rate_hz=int(rate))
        config = msgspec.structs.replace(config, link=link)
    try:
        # Compiling the physics takes seconds the first time; a port that is silent for so long
        # would look like a dead board.
        build(config, rate_hz=100, seed=0).step()
        boards = built(
            config,
            seed=config.plant.seed if seed is None else seed,
            faults=faults,
            model_path=model_path,
            effects=effects,
            firmware=firmware,
            store_path=store_path,
        )
        with boards as benches:
            for line in effect_lines(next(iter(benches.values())).plant.effects, effects):
                click.echo(line, err=True)
            stats, counts = serve(
                benches,
                speed=config.plant.speed_ratio if speed is None else speed,
                symlink=symlink,
                transport=transport,
                paced_by_host=paced_by_host,
                host_timeout_s=patience * HOST_TIMEOUT_S if paced_by_host else None,
                max_seconds=seconds,
                on_ready=_announce,
            )
    except (BenchError, PlantError) as error:
        raise SimulatedBenchError(str(error), action="see smad sim --help") from error
    click.echo(
        f"ended after {stats.samples} samples; {counts.bytes_in} bytes in, "
        f"{counts.bytes_out} out, {counts.dropped} writes dropped; "
        f"fell behind the clock {stats.grid_restarts} times, {said_of_host(stats)}",
        err=True,
    )


def _announce(names: Mapping[str, str]) -> None:
    ports = ", ".join(f"{axis} {name}".strip() for axis, name in names.items())
    click.echo(f"{READY}{ports}")
