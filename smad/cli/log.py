"""`smad log`: look at run logs, and turn them into other files and back."""

import os
import shlex
from pathlib import Path

import click

from smad.cli import complete
from smad.cli.options import FOLDER, OUTPUT, PATH, Group, argument, flag, json_option, option
from smad.cli.output import print_json
from smad.cli.quantity import Quantity, Whole
from smad.counted import counted
from smad.errors import RunLogError
from smad.files import display_path, require_writable
from smad.runlog.formats import FORMATS
from smad.runlog.paths import newest_run
from smad.view.terminal.progress import bar
from smad.view.terminal.tables import print_columns

_HERE = "runs"
_LAYOUTS = """\
Foxglove, Lichtblick: Layouts > Import from file, then open a run log.
PlotJuggler: open a run log, or start the ZeroMQ stream, then File > Load Layout."""


def _folder_of_bench(context: click.Context, parameter: click.Parameter, folder: str | None) -> str:
    """Return the folder given; else that of the bench whose daemon runs; else `runs` here."""
    if folder is not None or context.resilient_parsing:
        return folder or _HERE
    from smad.client.folder import recording_folder

    of_bench = recording_folder(os.environ.get("SMAD_BENCH", "bench"), timeout_s=2.0)
    return display_path(of_bench) if of_bench is not None and of_bench.is_dir() else _HERE


_folder = option(
    "--folder",
    "Without PATH: folder of the run logs [default: that of the running daemon, else runs]",
    envvar="SMAD_RUNS",
    callback=_folder_of_bench,
)
_axis = option("--axis", "The axis, if the log has several.", default="", show_default=False)
_path = argument(PATH, required=False, shell_complete=complete.runs)


@click.group(cls=Group)
def log() -> None:
    """List, show, plot, export, import and recover run logs.

    Without PATH, the newest log of the folder is used.
    """


@log.command()
def layouts(
    folder: Path = argument(FOLDER, default="layouts"),
    axes: tuple[str, ...] = option(
        "--axis", "An axis, if the bench has several; may be repeated.", multiple=True
    ),
) -> None:
    """Write layouts for PlotJuggler and Foxglove into FOLDER.

    With several axes, each has a tab.
    """
    from smad.view.layouts import write_layouts

    for path in write_layouts(folder, axes):
        click.echo(path)
    click.echo(_LAYOUTS)


@log.command("list")
def list_command(
    place: str | None = argument(metavar="[PATH]", required=False),
    folder: str = _folder,
    as_json: bool = json_option,
) -> None:
    """List the run logs of the folder PATH, or of --folder."""
    from smad.runlog import words
    from smad.runlog.overview import list_runs

    runs = list_runs(folder := place or folder)
    if as_json:
        print_json(runs)
        return
    source = click.get_current_context().get_parameter_source("folder")
    unasked = not place and source is click.core.ParameterSource.DEFAULT and folder != _HERE
    if not runs or unasked:
        click.echo(f"in {folder}:" if runs else f"no run logs in {folder}", err=bool(runs))
    if runs:
        print_columns(words.OVERVIEW, [words.overview_row(run) for run in runs], numeric=(4, 5, 6))


@log.command()
def show(
    path: Path | None = _path, folder: str = _folder, axis: str = _axis, as_json: bool = json_option
) -> None:
    """Summarise a run log: header, range of each channel, events."""
    from smad.runlog import words
    from smad.runlog.reader import read_run
    from smad.runlog.summary import summarise

    with bar("reading") as progress:
        run = read_run(path or newest_run(folder), axis=axis, progress=progress)
    summary = summarise(run)
    if as_json:
        print_json(summary)
        return
    click.echo("\n".join((*words.header_lines(summary), "")))
    print_columns(words.CHANNELS, words.channel_rows(summary), numeric=(2, 3, 4, 5))
    for line in words.ending_lines(summary):
        click.echo(line)
    if run.cut_short or run.damaged:
        click.echo(
            "\nthe log is incomplete; this is what could be read. To write that as a complete "
            "log: " + shlex.join(["smad", "log", "recover", summary.path])
        )


@log.command()
def export(
    *,
    path: Path | None = _path,
    folder: str = _folder,
    suffix: str | None = option(
        "--to",
        "Format, if --output does not name it  [default: csv]",
        click.Choice(FORMATS),
    ),
    output: Path | None = option("-o --output", "File, or folder of a bag, to write.", PATH),
    overwrite: bool = flag("--overwrite", "Replace a file that is there."),
    wide: bool = flag("--wide", "Several axes in one table: NAME.channel."),
    fps: int | None = option("--fps", "Frames per second, for lerobot.", Whole(1, 1000)),
    as_json: bool = json_option,
) -> None:
    """Write a run log as CSV, Parquet, MATLAB, ROS or LeRobot file.

    The file goes beside the log unless --output says where. Each of several axes gets a file, or
    with --wide all share a table. rosbag2 is a ROS 2 bag: a folder with an MCAP file of standard
    messages. lerobot is a dataset of LeRobot v3.0: a folder with Parquet files, of one episode.
    """
    from smad.runlog.export import with_readable_metadata
    from smad.runlog.formats import count_in, export_axes
    from smad.runlog.reader import read_axes

    source = path or newest_run(folder)
    target = output or source.with_suffix(f".{suffix or 'csv'}")
    with bar("reading") as progress:
        read = read_axes(source, progress=progress)
    runs = {axis: with_readable_metadata(run, target) for axis, run in read.items()}
    files = export_axes(runs, target, kind=suffix or "", wide=wide, fps=fps, overwrite=overwrite)
    notes = next(iter(runs.values())).notes
    count, what = count_in(files, runs)
    if as_json:
        print_json({"files": [str(file) for file in files], what: count, "notes": notes})
        return
    click.echo(f"{count} {what} to {' and '.join(str(file) for file in files)}")
    for note in notes:
        click.echo(f"note: {note}")


@log.command()
def split(path: Path | None = _path, folder: str = _folder) -> None:
    """Write one run log for each axis, beside the log."""
    from smad.runlog.one_axis import extract
    from smad.runlog.reader import read_axes

    source = path or newest_run(folder)
    if len(read := read_axes(source)) == 1 and "" in read:
        raise RunLogError(f"{source} is the log of a bench of one axis", action="use it as it is")
    written = {extract(source, axis): len(run) for axis, run in read.items()}
    for file, rows in written.items():
        click.echo(f"{counted(rows, 'row')} to {file}")


@log.command()
def plot(
    *,
    paths: tuple[Path, ...] = argument(
        PATH, metavar="[PATH]...", nargs=-1, shell_complete=complete.runs
    ),
    folder: str = _folder,
    output: Path | None = option("-o --output", "Without --figure: page to write.", OUTPUT),
    from_s: float | None = option("--from", "First second to draw.", Quantity("s")),
    to_s: float | None = option("--to", "Last second to draw.", Quantity("s")),
    open_page: bool = flag("--open", "Without --figure: open the page in a browser."),
    figure: Path | None = option(
        "--figure",
        "Write the panels as a figure for print in place of a page: .svg, .pdf or .png.",
        OUTPUT,
    ),
    width_mm: float = option(
        "--width MM",
        "With --figure: its width; a column of a journal is about 85, two are 175.",
        Quantity("mm", 40.0, 400.0),
        default=85.0,
    ),
    axis: str = _axis,
) -> None:
    """Make a page with plots of one or more run logs.

    The plots zoom and show the values under the pointer. Several runs are overlaid from their first
    samples on; those of a bench are drawn over those of a simulation. The page is one file and
    needs no network.
    """
    from smad.report.page import write_page
    from smad.report.runs import page_of, run_parts
    from smad.runlog.reader import read_run

    sources = paths or (newest_run(folder),)
    runs = []
    for source in sources:
        with bar(f"reading {source.name}") as progress:
            runs.append(read_run(source, axis=axis, progress=progress))
    drawn = run_parts(runs, from_s, to_s)
    if figure is not None:
        from smad.report.printed import write_figure
        from smad.report.runs import panels_of

        click.echo(write_figure(panels_of(drawn), figure, width_mm=width_mm))
        return
    page = page_of(drawn)
    written = write_page(page, output or sources[0].with_suffix(".html"))
    click.echo(written)
    if open_page:
        click.launch(str(written))


@log.command("import")
def import_command(
    source: Path = argument(PATH),
    output: Path | None = option("-o --output", "Run log to write.", PATH),
    mapping: Path | None = option(
        "--mapping", "TOML file that says what the columns are, if their names do not.", PATH
    ),
    as_json: bool = json_option,
) -> None:
    """Make a run log from a CSV or Parquet file, or a ROS bag.

    The names of the columns end with their units, or --mapping says what they are.
    """
    from smad.records.channels import read_mapping
    from smad.records.importer import import_table

    if output is not None:
        require_writable(output)
    rules = read_mapping(mapping) if mapping is not None else None
    done = import_table(source, output or source.with_suffix(".mcap"), rules)
    if as_json:
        print_json(done)
        return
    click.echo(f"{counted(done.rows, 'row')} to {done.path}")
    print_columns(("column", "channel"), list(done.channel_of.items()))
    for line in done.lines():
        click.echo(line)


@log.command()
def recover(
    path: Path | None = _path,
    folder: str = _folder,
    output: Path | None = option("-o --output", "Run log to write.", PATH),
    as_json: bool = json_option,
) -> None:
    """Write an intact copy of a damaged log; report what was lost."""
    from smad.runlog.recover import recover as recover_log

    if output is not None:
        require_writable(output)
    with bar("recovering") as progress:
        done = recover_log(path or newest_run(folder), output, progress=progress)
    if as_json:
        print_json(done)
        return
    click.echo("\n".join(done.lines()))
