"""Names of run logs, and what lies beside them."""

from pathlib import Path

from smad.health import record
from smad.queue import lease, store
from smad.runlog.paths import passed_over


def test_files_that_smad_writes_beside_runs_are_not_listed_as_passed_over(tmp_path: Path) -> None:
    run, foreign = tmp_path / "a.mcap", tmp_path / "notes.txt"
    names = (record.FILE, lease.FILE, store.FILE, f"{store.FILE}-wal", f"{store.FILE}-shm")
    own = [tmp_path / name for name in names]
    assert passed_over(tmp_path, [run, *own], [run]) == ""
    said = passed_over(tmp_path, [run, foreign, *own], [run])
    assert said == f"{tmp_path}: read 1 run, passed over notes.txt"
