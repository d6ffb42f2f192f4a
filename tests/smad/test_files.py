"""A file that was named wrongly is refused in one line, and no folder is made for it."""

from pathlib import Path

import pytest

from smad.cli import execute
from smad.errors import CommandError
from smad.files import append_lines, replacing, require_writable, write_whole
from smad.report.page import Page, write_page
from tests.smad.runlog.helpers import write_small_run


@pytest.mark.parametrize("command", ["export", "plot", "recover", "import"])
def test_no_command_makes_a_folder_for_a_file_that_was_named(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = write_small_run(tmp_path / "a.mcap", 50)
    suffix = {"export": "csv", "plot": "html"}.get(command, "mcap")
    target = tmp_path / "none" / f"a.{suffix}"
    assert execute(["log", command, str(log), "-o", str(target)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "none" in line
    assert not target.parent.exists()


def test_a_page_is_not_written_into_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="there is no folder"):
        require_writable(tmp_path / "no" / "a.html")
    with pytest.raises(CommandError, match="it is a folder"):
        require_writable(tmp_path)
    with pytest.raises(Exception, match="cannot be written"):
        write_page(Page("t", []), tmp_path / "no" / "a.html")
    assert not (tmp_path / "no").exists()


def test_log_list_takes_a_folder_as_its_argument(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_small_run(tmp_path / "a.mcap", 50)
    assert execute(["log", "list", str(tmp_path)]) == 0
    assert "a.mcap" in capsys.readouterr().out


def test_a_file_is_replaced_whole_or_stays_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_whole(path, "ä\n")

    def break_off() -> None:
        with replacing(path) as partial:
            partial.write_text("half")
            raise OSError("the disk is full")

    with pytest.raises(OSError, match="the disk is full"):
        break_off()
    assert path.read_text("utf-8") == "ä\n"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize(
    ("before", "after"),
    [(None, "n,s\n1,2\n"), ("n,", "n,s\n1,2\n"), ("n,s\n3,4\n5", "n,s\n3,4\n1,2\n")],
)
def test_lines_are_added_to_a_file_without_its_cut_line_and_below_one_head(
    tmp_path: Path, before: str | None, after: str
) -> None:
    path = tmp_path / "a.csv"
    if before is not None:
        path.write_text(before)
    append_lines(path, b"1,2\n", head=b"n,s\n")
    assert path.read_text() == after


def test_lines_stay_that_another_program_adds_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, read_bytes = tmp_path / "a.csv", Path.read_bytes
    path.write_text("1\n")

    def read_before_another_writes(self: Path) -> bytes:
        data = read_bytes(self)
        self.write_bytes(data + b"2\n")
        return data

    monkeypatch.setattr(Path, "read_bytes", read_before_another_writes)
    append_lines(path, b"3\n")
    assert path.read_text() == "1\n2\n3\n"
