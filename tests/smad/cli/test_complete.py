"""What the tab key offers."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.shell_completion import ShellComplete

from smad.cli import root


def offered(*words: str) -> list[str]:
    *before, typed = words
    shell = ShellComplete(root, {}, "smad", "_SMAD_COMPLETE")
    return [item.value for item in shell.get_completions(list(before), typed)]


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("params", "get", "current_l"), "current_limit_mA"),
        (("params", "set", ""), "current_limit_mA"),
        (("run", "fig9"), "fig9-cycle"),
        (("run", "dsc", "al"), "all"),
        (("run", "rep"), "repeat"),
        (("sim", "--effect", "rtd_"), "rtd_lag"),
        (("gap", "next", "--effect", "rtd_l"), "rtd_lag"),
        (("faults", "explain", "over"), "OVER_TEMPERATURE"),
        (("clear", "OVER_T"), "OVER_TEMPERATURE"),
        (("sta",), "status"),
    ],
)
def test_a_name_is_offered_where_one_is_wanted(words: tuple[str, ...], name: str) -> None:
    found = offered(*words)
    assert name in found
    assert all(value.lower().startswith(words[-1].lower()) for value in found)


def test_runs_of_the_folder_are_offered_newest_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("20261120-050709-a", "20261121-050709-b"):
        (tmp_path / "runs").mkdir(exist_ok=True)
        (tmp_path / f"runs/{name}.mcap").touch()
    expected = ["runs/20261121-050709-b.mcap", "runs/20261120-050709-a.mcap"]
    assert offered("log", "show", "") == expected
    assert offered("log", "plot", expected[0], "runs/202611") == expected
    assert offered("log", "show", "else") == ["else"], "any other file, by the shell"
