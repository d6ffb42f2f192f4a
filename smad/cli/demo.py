"""`smad demo`: the main job on a simulated bench, from arming to the page with the plots."""

from pathlib import Path

import click

from smad.cli.options import PATH, Command, option
from smad.cli.quantity import Whole
from smad.processes.boards import BOARDS
from smad.view.terminal.progress import progress


@click.command(cls=Command)
def demo(
    folder: Path = option(
        "--folder", "Where the run log and the page go.", PATH, default=Path("runs")
    ),
    seed: int = option("--seed", "Seed of all noise.", Whole(0, 2**32 - 1), default=0),
    boards: tuple[str, ...] = option(
        "--firmware",
        "The board, see smad sim --help; repeat the option for another board beside it.",
        click.Choice([*BOARDS]),
        default=["python"],
        multiple=True,
    ),
) -> None:
    """Run steps and a sinusoid on a simulated bench; show numbers.

    The same seed gives the same bench. The table's last digits still differ from run to run: the
    noise depends on when the bench was armed.
    """
    from smad.demo import figures
    from smad.demo.play import play
    from smad.view.terminal.tables import print_table

    with progress() as line:
        played = {board: play(folder, seed, board, line.say) for board in boards}
    print_table(figures.beside({board: table for board, (_, _, table) in played.items()}))
    for path, page, _ in played.values():
        click.echo(f"run log  {path}\npage     {page}")
