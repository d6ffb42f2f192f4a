"""`smad demo`: the main job on a simulated bench, from arming to the page with the plots."""

from pathlib import Path

import click

from smad.cli.output import PATH, Progress
from smad.cli.quantity import Whole
from smad.processes.boards import BOARDS


@click.command()
@click.option(
    "--folder", type=PATH, default=Path("runs"), help="Where the run log and the page go."
)
@click.option("--seed", type=Whole(0, 2**32 - 1), default=0, help="Seed of all noise.")
@click.option(
    "--firmware",
    "boards",
    type=click.Choice([*BOARDS]),
    default=["python"],
    multiple=True,
    help="The board, see smad sim --help; give it again for another one beside it.",
)
def demo(folder: Path, seed: int, boards: tuple[str, ...]) -> None:
    """Run steps and a sinusoid on a simulated bench; show numbers.

    The same seed gives the same bench. The table's last digits still differ from run to run: the
    noise depends on when the bench was armed.
    """
    from smad.cli.tables import print_table
    from smad.demo import figures
    from smad.demo.play import play

    line = Progress()
    tables, places = {}, []
    for board in boards:
        run, tables[board] = play(folder, seed, board, line.say)
        line.say("reading the run log and drawing")
        page = run.path.with_suffix(".html")
        figures.write(page, run, tables[board])
        places.append(f"run log  {run.path}\npage     {page}")
    line.done()
    print_table(figures.beside(tables))
    click.echo("\n".join(places))
