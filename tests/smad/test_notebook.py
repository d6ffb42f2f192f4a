"""What a notebook shows, and a run in pandas."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

import smad
from smad.errors import MissingPartError
from smad.notebook import table
from smad.runlog.reader import read_run
from tests.smad.cli.test_commands import STATUS
from tests.smad.runlog.helpers import write_small_run


def test_dir_names_what_can_be_imported() -> None:
    assert {"Client", "AsyncClient", "read_run"} <= set(dir(smad))
    assert all(hasattr(smad, name) for name in smad.__all__)
    assert smad.read_run is read_run


def test_what_a_stranger_wrote_is_text_in_a_notebook() -> None:
    html = table("<b>", ("<i>",), [("<u>",)], "<s>")
    assert [tag for tag in ("<b>", "<i>", "<u>", "<s>") if tag in html] == []


def test_a_run_shows_its_channels_with_units(tmp_path: Path) -> None:
    html = read_run(write_small_run(tmp_path / "run.mcap", 100))._repr_html_()
    assert "run.mcap: 100 rows, 0.99 s, sim" in html
    assert "displacement_mm</td>" in html
    assert "stage_mm" not in html


def test_the_status_shows_fault_and_readings() -> None:
    html = STATUS._repr_html_()
    assert "1.25 mm" in html
    assert "30.0 °C" in html
    assert "None" not in html


def test_a_run_in_pandas_has_board_time_words_and_gaps(tmp_path: Path) -> None:
    frame = read_run(write_small_run(tmp_path / "run.mcap", 100)).to_pandas()
    assert frame.index.name == "t_s"
    assert frame.loc[0.5:0.6, "i_cmd_x_A"].tolist() == pytest.approx(
        [n / 1000 for n in range(50, 61)]
    )
    assert set(frame["mode"]) == {"ARMED"}
    assert frame["displacement_mm"].isna().sum() == 34
    assert frame["tick"].dtype == "Int64"
    assert frame.attrs["units"]["rtd_x_degC"] == "degC"
    assert "stage_mm" not in frame


def test_without_pandas_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = read_run(write_small_run(tmp_path / "run.mcap", 10))
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingPartError, match=r"pip install '\.\[notebook\]'"):
        run.to_pandas()
