"""`smad sim`: the simulated bench alone, behind a pseudo-terminal."""

from collections.abc import Mapping
from pathlib import Path

import click

from smad.cli.options import FILE, PATH, Command, config_option, option, together
from smad.cli.quantity import Quantity
from smad.cli.simulated import Boards, effects_option, rate_option
from smad.processes.boards import SimulatedBenchError, built, effect_lines
from smad.processes.simulator import READY


@click.command(cls=Command)
def sim(
    *,
    path: Path | None = config_option,
    symlink: Path | None = option("--symlink", "A lasting name for the port.", PATH),
    model_path: Path | None = option(
        "--model",
        "Model file of smad gap diagnose --apply, in place of the configured plant.",
        PATH,
    ),
    effects: tuple[str, ...] = effects_option(
        "An effect that the bench has (smad gap effects); typical strength without values."
    ),
    rate: str | None = rate_option,
    boards: Boards = together(Boards),
    store_path: Path | None = option(
        "--store", "File of the board's parameter memory, for --firmware host.", FILE
    ),
    seconds: float | None = option("--for S", "End after this time.", Quantity("s", 0.0, 1e9)),
    transport: str = option("--transport", "pty, or fd:N,… (sockets).", default="pty"),
) -> None:
    """Run the simulated bench alone, without a daemon.

    It prints the name of its port. Each of several axes has a port, and a fault is then
    --fault AXIS:FAULT. Ctrl-C ends the bench.
    """
    from sim_device.errors import BenchError
    from sim_device.plant.errors import PlantError
    from sim_device.pty import HOST_TIMEOUT_S, in_words, serve

    config = boards.configured(path, rate)
    try:
        boards_built = built(
            config,
            seed=config.plant.seed,
            faults=boards.faults,
            model_path=model_path,
            effects=effects,
            firmware=boards.firmware,
            store_path=store_path,
        )
        with boards_built as benches:
            for line in effect_lines(next(iter(benches.values())).plant.effects, effects):
                click.echo(line, err=True)
            stats, counts = serve(
                benches,
                speed=config.plant.speed_ratio,
                symlink=symlink,
                transport=transport,
                paced_by_host=boards.paced_by_host,
                host_timeout_s=boards.patience * HOST_TIMEOUT_S if boards.paced_by_host else None,
                max_seconds=seconds,
                on_ready=_announce,
            )
    except (BenchError, PlantError) as error:
        raise SimulatedBenchError(str(error), action="see smad sim --help") from error
    click.echo(in_words(stats, counts), err=True)


def _announce(names: Mapping[str, str]) -> None:
    ports = ", ".join(f"{axis} {name}".strip() for axis, name in names.items())
    click.echo(f"{READY}{ports}")
