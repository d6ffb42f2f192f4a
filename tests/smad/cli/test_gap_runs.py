"""Runs on the command line: files, patterns and folders, several to an option."""

from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from smad.cli.gap_runs import ManyRuns, good_option, hold_out_option, runs_argument
from smad.cli.options import option


@click.command(cls=ManyRuns)
def command(
    runs: tuple[Path, ...] = runs_argument,
    hold_out: tuple[Path, ...] = hold_out_option,
    good: tuple[Path, ...] = good_option,
    seed: int = option("--seed", type=int, default=0),
) -> None:
    for group in (runs, hold_out, good):
        click.echo(" ".join(path.name for path in group))


@pytest.fixture
def ask(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    for name in ("a.mcap", "b.mcap", "c.mcap", "good/1.mcap", "good/2.mcap", "good/notes.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path)
    return lambda *args: CliRunner().invoke(command, args)


@pytest.mark.parametrize(
    "arguments",
    [
        ("a.mcap", "--hold-out", "b.mcap", "c.mcap", "--good", "good"),
        ("a.mcap", "--hold-out", "b.mcap", "--hold-out", "c.mcap", "--good", "good/*.mcap"),
        (
            "a.mcap",
            "--hold-out",
            "[bc].mcap",
            "--seed",
            "3",
            "--good",
            "good/1.mcap",
            "good/2.mcap",
        ),
    ],
)
def test_an_option_takes_several_files_a_pattern_or_a_folder(ask, arguments) -> None:  # type: ignore[no-untyped-def]
    done = ask(*arguments)
    assert done.stdout.splitlines() == ["a.mcap", "b.mcap c.mcap", "1.mcap 2.mcap"]
    if "good" in arguments:
        assert done.stderr == "good: read 2 runs, passed over notes.txt\n"


def test_a_folder_without_run_logs_stands_for_its_tables(ask, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    for name in ("good/1.csv", "tables/1.csv.gz", "tables/2.parquet", "tables/notes.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert ask("a.mcap", "--good", "good").stdout.splitlines()[2] == "1.mcap 2.mcap"
    assert ask("a.mcap", "--good", "tables").stdout.splitlines()[2] == "1.csv.gz 2.parquet"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("a.mcap", "--hold-out", "empty"), "holds no run log"),
        (("no*.mcap",), "no file, folder or match"),
        (("--hold-out", "a.mcap", "b.mcap"), "Missing argument"),
        (("a.mcap", "--good"), "requires an argument"),
    ],
)
def test_what_stands_for_no_run_is_refused_by_name(ask, arguments, said: str) -> None:  # type: ignore[no-untyped-def]
    done = ask(*arguments)
    assert done.exit_code == 2
    assert said in done.output
