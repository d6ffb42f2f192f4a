"""Answers that were computed are on the disk before anything is printed, whoever reads it."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import smad.cli
from smad.cli import execute
from smad.diagnosis.verdict import REFUSED, Verdict
from smad.errors import CommandError
from smad.files import named_output
from tests.smad.records.kinds import as_csv, pair


@pytest.fixture
def refused(tmp_path: Path) -> list[str]:
    """A diagnosis that is refused at once, and the files that it is to write."""
    short = {name: column[:110] for name, column in pair().columns.items()}
    run = as_csv(short, tmp_path / "short.csv")
    return ["gap", "diagnose", str(run), "--json", str(tmp_path / "v.json"),
            "--report", str(tmp_path / "v.html")]  # fmt: skip


def asked(words: list[str], shell: str) -> subprocess.CompletedProcess[str]:
    """The command in a shell that does with its output what `shell` says."""
    command = " ".join([sys.executable, "-m", "smad", *words])
    return subprocess.run(
        ["bash", "-c", f"{command} {shell}"], capture_output=True, text=True, check=False
    )


def verdict(folder: Path) -> Verdict:
    return Verdict.from_json((folder / "v.json").read_bytes())


def test_a_refused_diagnosis_has_a_status_of_its_own_and_writes_its_files(
    refused: list[str], tmp_path: Path
) -> None:
    assert execute(refused) == 3
    found = verdict(tmp_path)
    assert found.outcome == REFUSED
    assert [f.kind for f in found.findings if f.refuses] == ["too short"]
    assert "at least 8\u00a0s are needed" in (tmp_path / "v.html").read_text()


@pytest.mark.parametrize(
    ("shell", "words"),
    [
        ("> /dev/full", "the answer cannot be printed: No space left on device"),
        ("| true", ""),
        ("| head -1; exit ${PIPESTATUS[0]}", ""),
        (">&-", ""),
        ("<&- >&- 2>&-", ""),
        ("2>&1 | true", ""),
        ("2> /dev/full", ""),
    ],
)
def test_output_that_nobody_takes_loses_no_file_and_is_no_internal_error(
    shell: str, words: str, refused: list[str], tmp_path: Path
) -> None:
    done = asked(refused, shell)
    assert verdict(tmp_path).outcome == REFUSED
    assert "Traceback" not in done.stderr
    assert "internal error" not in done.stderr
    assert words in done.stderr


def test_a_file_that_cannot_be_written_is_told_before_anything_is_computed(
    refused: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert execute([*refused, "--apply", str(tmp_path / "gone" / "m.toml")]) == 1
    assert "there is no folder" in capfd.readouterr().err
    assert not (tmp_path / "v.json").exists()


def test_a_file_keeps_its_content_until_the_new_one_is_whole(tmp_path: Path) -> None:
    target = tmp_path / "v.json"
    target.write_text("old")
    with pytest.raises(ZeroDivisionError), named_output(target) as path:
        path.write_text(f"half of the n{1 / 0}")
    assert target.read_text() == "old"
    with named_output(target) as path:
        path.write_text("new")
    assert [p.name for p in tmp_path.iterdir()] == ["v.json"]
    assert target.read_text() == "new"
    with pytest.raises(CommandError, match="cannot write"), named_output(target) as path:
        raise OSError(28, "No space left on device")


_WRITES = {"write_page", "write_whole", "write_figure", "show_verdict", "named_output",
           "export_run", "extract", "write_campaign"}  # fmt: skip
_PRINTS = {"echo", "secho", "print_table", "_print_table", "_print_tables", "_print_json",
           "print_verdict", "show_verdict", "print_answer"}  # fmt: skip


def written_late(block: list[ast.stmt], *, printed: bool = False) -> list[int]:
    """Lines of a block of code that write a file after something was printed."""
    late: list[int] = []
    for statement in block:
        inner = [
            b for name in ("body", "orelse", "finalbody") if (b := getattr(statement, name, []))
        ]
        for branch in inner:
            late += written_late(branch, printed=printed)
        calls = [c for c in ast.walk(statement) if isinstance(c, ast.Call)]
        names = {
            getattr(c.func, "attr", getattr(c.func, "id", ""))
            for c in calls
            if not any(k.arg == "err" for k in c.keywords)
        }
        if printed and not inner and names & _WRITES:
            late.append(statement.lineno)
        leaves = any(isinstance(b[-1], ast.Return | ast.Raise) for b in inner)
        printed |= bool(names & _PRINTS) and not leaves
    return late


def test_every_command_writes_its_files_before_it_prints() -> None:
    files = sorted(Path(smad.cli.__file__).parent.glob("*.py"))
    functions = [
        (file.name, f)
        for file in files
        for f in ast.walk(ast.parse(file.read_text()))
        if isinstance(f, ast.FunctionDef)
    ]
    assert {name: late for name, f in functions if (late := written_late(f.body))} == {}
    late = ast.parse("def f():\n    click.echo(1)\n    write_page(page, path)\n").body
    assert written_late(late[0].body) == [3]  # type: ignore[attr-defined]
