"""Banks that others bring: how they are read, and what is said of one that is broken."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from evaluation.command import main
from evaluation.errors import BankError
from evaluation.run.judging import Check
from evaluation.run.manifest import ROLES, read_manifest
from smad.diagnosis.runs import GapRun

N = 400


def columns() -> dict[str, Any]:
    """Four seconds of a bench at rest."""
    t = np.arange(N) * 0.01
    names = ("i_applied_x_A", "i_applied_y_A", "duty_x", "duty_y", "displacement_mm", "force_N")
    return {"t_s": t, "valid": np.ones(N)} | {n: np.zeros(N) for n in names}


def write(folder: Path, file: str, table: Mapping[str, Any]) -> None:
    """A run file; the suffix chooses its kind."""
    path = folder / file
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".parquet":
        pq.write_table(pa.table({n: pa.array(v, from_pandas=True) for n, v in table.items()}), path)
        return
    write_csv(path, list(table), list(table.values()))


def write_csv(path: Path, names: list[str], table: Sequence[Any]) -> None:
    """Columns as they are given, of one name twice, too."""
    rows = zip(*table, strict=True)
    text = [",".join(names), *(",".join(_cell(v) for v in row) for row in rows)]
    path.write_text("\n".join(text) + "\n")


def _cell(value: Any) -> str:
    return "" if isinstance(value, float) and np.isnan(value) else str(value)


def make(folder: Path, count: int = 1, **changes: Any) -> Path:
    """A bank of `count` cases of one fit run and one good run each."""
    cases = []
    for i in range(1, count + 1):
        runs = [
            {"file": f"case-{i}/{role}.parquet", "role": role, "family": "steps", "bench": "this"}
            for role in ("fit", "good")
        ]
        for run in runs:
            write(folder, run["file"], columns())
        cases.append({"id": f"case-{i}", "question": "changed", "runs": runs})
    manifest = {"format": "smad-bank-1", "bank": "mine", "columns": {}, "cases": cases} | changes
    (folder / "manifest.json").write_text(json.dumps(manifest))
    return folder


def opened(folder: Path) -> Check:
    """A check of the whole bank."""
    return Check(folder=folder, manifest=read_manifest(folder))


def first(folder: Path) -> dict[str, list[GapRun]]:
    """The runs of its first case."""
    check = opened(folder)
    return check.runs(check.manifest.cases[0], *ROLES)


def test_a_bank_is_read_by_role_and_units(tmp_path: Path) -> None:
    runs = first(make(tmp_path))
    assert [r.name for r in runs["fit"]] == ["fit"]
    assert [r.name for r in runs["good"]] == ["good"]
    assert runs["hold_out"] == []
    assert runs["fit"][0].dt_s == pytest.approx(0.01)


def test_a_case_that_asks_what_differs_has_no_good_runs(tmp_path: Path) -> None:
    make(tmp_path)
    text = (tmp_path / "manifest.json").read_text().replace('"changed"', '"differs"')
    (tmp_path / "manifest.json").write_text(text)
    assert first(tmp_path)["good"] == []


def test_the_manifest_that_the_page_shows_can_be_read(tmp_path: Path) -> None:
    guide = Path(__file__).parents[2] / "evaluation" / "README.md"
    manifest, *_ = re.findall(r"```json\n(.*?)```", guide.read_text(), re.DOTALL)
    (tmp_path / "manifest.json").write_text(manifest)
    assert read_manifest(tmp_path).cases[0].id == "case-001"


def test_runs_of_one_name_in_two_folders_stay_apart(tmp_path: Path) -> None:
    make(tmp_path)
    write(tmp_path, "other/fit.parquet", columns())
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    manifest["cases"][0]["runs"].append({"file": "other/fit.parquet", "role": "hold_out"})
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    runs = first(tmp_path)
    assert len({r.name for own in runs.values() for r in own}) == 3


def test_missing_samples_and_flagged_rows_are_not_valid(tmp_path: Path) -> None:
    table = columns()
    table["force_N"][5] = np.nan
    table["valid"][7] = 0.0
    make(tmp_path)
    write(tmp_path, "case-1/fit.parquet", table)
    good = first(tmp_path)["fit"][0].good
    assert not good[5]
    assert not good[7]
    assert good.sum() == N - 2


def test_what_was_read_in_a_flagged_row_is_not_fed_to_a_model(tmp_path: Path) -> None:
    table = columns()
    table["force_N"][:] = table["t_s"]
    table["force_N"][7] = 99.0
    table["valid"][7] = 0.0
    make(tmp_path)
    write(tmp_path, "case-1/fit.parquet", table)
    run = first(tmp_path)["fit"][0]
    np.testing.assert_allclose(run.outputs["force_N"], table["t_s"])


def test_a_run_of_flagged_rows_only_keeps_its_channels_and_has_no_valid_sample(
    tmp_path: Path,
) -> None:
    table = columns() | {"valid": np.zeros(N)}
    make(tmp_path)
    write(tmp_path, "case-1/fit.parquet", table)
    run = first(tmp_path)["fit"][0]
    assert "force_N" in run.outputs
    assert not run.good.any()


def test_a_bank_of_check_ups_has_the_files_of_its_folders(tmp_path: Path) -> None:
    manifest = {"format": "smad-checkup-1", "bank": "m", "cases": [{"id": "a", "bench": "b"}]}
    for place in ("cases/a", "benches/b/good-1", "benches/b/good-2"):
        for name in ("run-1", "run-2"):
            write(tmp_path, f"{place}/{name}.parquet", columns())
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    (case,) = read_manifest(tmp_path).benches["b"]
    assert [(r.file, r.role) for r in case.of("fit")] == [
        ("cases/a/run-1.parquet", "fit"),
        ("cases/a/run-2.parquet", "fit"),
    ]
    assert [r.name for r in case.of("good")] == ["run-1", "run-2"] * 2
    assert [r.name for r in opened(tmp_path).runs(case, "fit")["fit"]] == ["run-1", "run-2"]


def _refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    folder, *more = arguments
    with pytest.raises(SystemExit, match="2"):
        main(["check", folder, "--out", f"{folder}/verdicts.json", *more])
    (said,) = capsys.readouterr().err.strip().splitlines()
    assert said.startswith("error: ")
    return said


@pytest.mark.parametrize(
    ("changes", "parts"),
    [
        ({"format": "smad-bank-9"}, ("smad-bank-9", "A bank of your own")),
        ({"format": "smad-checkup-1"}, ("asks changed", "smad-checkup-1")),
        ({"cases": []}, ("no cases",)),
        ({"cases": [{"id": "a"}]}, ("asks check-up", "smad-bank-1")),
        ({"cases": [{"id": "a", "question": "why", "runs": []}]}, ("question", "why")),
        ({"cases": [{"id": "a", "question": "differs", "runs": []}]}, ("no run to fit on",)),
        (
            {"cases": [{"id": "a", "question": "changed",
                        "runs": [{"file": "x.parquet", "role": "fit"}]}]},
            ("a asks what has changed", "known-good run", "what differs"),
        ),
        (
            {"cases": [{"id": "a", "question": "differs",
                        "runs": [{"file": "../x.parquet", "role": "fit"}]}]},
            ("outside the bank", "../x.parquet"),
        ),
        (
            {"cases": [{"id": "a", "question": "differs",
                        "runs": [{"file": "x.parquet", "role": "test"}]}]},
            ("role", "test"),
        ),
    ],
)  # fmt: skip
def test_a_wrong_manifest_is_refused_with_its_place(
    changes: dict[str, Any],
    parts: tuple[str, ...],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    make(tmp_path, **changes)
    said = _refused(capsys, str(tmp_path))
    assert all(part in said for part in parts), said


def test_a_folder_without_manifest_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "manifest.json" in _refused(capsys, str(tmp_path))


def test_a_missing_run_file_is_named_before_any_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make(tmp_path, 2)
    (tmp_path / "case-2" / "good.parquet").unlink()
    said = _refused(capsys, str(tmp_path))
    assert "case-2: run file case-2/good.parquet" in said
    assert "--only" in said


def test_a_case_that_the_bank_does_not_have_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make(tmp_path, 2)
    said = _refused(capsys, str(tmp_path), "--only", "case-9")
    assert "case-9" in said
    assert "case-1 … case-2" in said


@pytest.mark.parametrize(
    ("gone", "said"), [("t_s", "time"), ("duty_y", "duty_y"), ("i_applied_x_A", "i_applied_x_A")]
)
def test_a_missing_column_is_named(gone: str, said: str, tmp_path: Path) -> None:
    table = columns()
    del table[gone]
    make(tmp_path)
    write(tmp_path, "case-1/fit.parquet", table)
    with pytest.raises(BankError, match=said) as caught:
        first(tmp_path)
    assert "case-1/fit.parquet" in str(caught.value)
    assert "the column" in str(caught.value)


def test_a_run_without_any_measured_channel_is_refused(tmp_path: Path) -> None:
    table = {n: v for n, v in columns().items() if n not in ("displacement_mm", "force_N")}
    make(tmp_path)
    write(tmp_path, "case-1/fit.parquet", table)
    with pytest.raises(BankError, match="no measured channel"):
        first(tmp_path)


def test_a_time_that_does_not_rise_is_refused(tmp_path: Path) -> None:
    table = columns()
    table["t_s"][10] = table["t_s"][9]
    make(tmp_path)
    write(tmp_path, "case-1/fit.parquet", table)
    with pytest.raises(BankError, match="row 11: time does not increase"):
        first(tmp_path)


def test_a_manifest_without_end_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "manifest.json").open("wb") as file:
        file.truncate(16_000_001)
    with pytest.raises(BankError, match="too large"):
        read_manifest(tmp_path)
