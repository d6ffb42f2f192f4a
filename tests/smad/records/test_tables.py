"""Tables of one run that others made: CSV, gzipped CSV and Parquet, whole or not."""

import gzip
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from smad.errors import LogImportError, RunLogError
from smad.records.channels import MappingFile, read_channels
from smad.records.column_names import ColumnRule
from smad.records.importer import import_table
from smad.records.tables import KINDS, read_columns
from smad.runlog.bounds import Together
from smad.runlog.reader import read_run

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "run-logs.md"
N = 40
MOST_TIMES = 3.0
"""Memory that reading a table takes, over that of its numbers."""


def columns() -> dict[str, Any]:
    """A force that moves, one sample missing."""
    t_s = np.arange(N) * 0.01
    force_N = np.sin(t_s)
    force_N[3] = np.nan
    return {"t_s": t_s, "force_N": force_N, "duty_x": np.zeros(N)}


def write(path: Path, names: list[str], values: list[Any]) -> Path:
    """A table of its suffix's kind; a name may stand twice."""
    if path.suffix == ".parquet":
        arrays = [pa.array(v, from_pandas=True) for v in values]
        pq.write_table(pa.Table.from_arrays(arrays, names), path)
        return path
    rows = [",".join(map(str, row)) for row in zip(*values, strict=True)]
    text = "\n".join([",".join(names), *rows]) + "\n"
    data = text.encode()
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


@pytest.mark.parametrize("kind", KINDS)
def test_a_table_of_any_kind_gives_the_same_channels(kind: str, tmp_path: Path) -> None:
    assert re.search(rf"\b{kind.split('.')[1]}\b", GUIDE.read_text(), re.IGNORECASE)
    table = columns()
    found = read_channels(write(tmp_path / f"a{kind}", list(table), list(table.values()))).columns
    assert found.keys() == table.keys()
    for channel, values in table.items():
        np.testing.assert_allclose(found[channel], values)


def test_a_parquet_file_becomes_a_run_log(tmp_path: Path) -> None:
    table = columns()
    names = ["time_ms", "Force [mN]", "duty_x"]
    values = [1e3 * table["t_s"], 1e3 * table["force_N"], table["duty_x"]]
    done = import_table(write(tmp_path / "a.parquet", names, values), tmp_path / "a.mcap")
    assert done.rows == N
    run = read_run(done.path)
    np.testing.assert_allclose(run.columns["force_N"], table["force_N"])
    np.testing.assert_allclose(run.columns["t_s"], table["t_s"])


@pytest.mark.parametrize("name", ["force_N", "duty_x", "t_s"])
@pytest.mark.parametrize("file", ["run.csv", "run.csv.gz", "run.parquet"])
def test_text_in_a_column_that_is_read_is_refused(name: str, file: str, tmp_path: Path) -> None:
    table = columns()
    table[name] = [*map(str, table[name][:-1]), "broken"]
    path = write(tmp_path / file, list(table), list(table.values()))
    with pytest.raises(LogImportError, match=f"column '{name}' is not a number.*broken"):
        read_channels(path)


@pytest.mark.parametrize("file", ["run.csv", "run.parquet"])
def test_a_column_that_stands_twice_is_refused(file: str, tmp_path: Path) -> None:
    table = columns()
    path = write(tmp_path / file, [*table, "force_N"], [*table.values(), table["force_N"]])
    with pytest.raises(LogImportError, match="two columns are named 'force_N'"):
        read_channels(path)


@pytest.mark.parametrize("file", ["run.csv", "run.parquet"])
def test_what_only_looks_like_a_channel_is_left_out_beside_the_channel(
    file: str, tmp_path: Path
) -> None:
    table = columns()
    spare = {"comment": ["warm-up"] * N, "force": np.ones(N), "load_kN": np.ones(N)}
    path = write(tmp_path / file, [*table, *spare], [*table.values(), *spare.values()])
    found = read_channels(path).columns
    assert found.keys() == table.keys()
    np.testing.assert_allclose(found["force_N"], table["force_N"])


@pytest.mark.parametrize("name", ["run.parquet", "run.csv.gz", "run.mat", "gone.csv"])
def test_a_file_that_cannot_be_read_is_one_sentence(name: str, tmp_path: Path) -> None:
    if not name.startswith("gone"):
        (tmp_path / name).write_bytes(b"nonsense")
    with pytest.raises(LogImportError, match=name.replace(".", r"\.")) as caught:
        read_channels(tmp_path / name)
    assert "\n" not in str(caught.value)


def named(count: int) -> bytes:
    """A line of names: the time and `count` others."""
    return b",".join([b"t_s", *(b"a%d" % k for k in range(count))]) + b"\n"


def _gzipped(path: Path, head: bytes, piece: bytes, times: int) -> None:
    with gzip.open(path, "wb", 1) as file:
        file.write(head)
        for _ in range(times):
            file.write(piece)


@pytest.mark.parametrize(
    ("head", "piece", "times", "limit"),
    [
        (b"t_s,a\n", b"0,0\n" * 100_000, 19, "1800000 rows"),
        (named(60), b",".join([b"0"] * 61) + b"\n", 1_200_000, "72000000 cells"),
        (b"t_s,a\n", b"1" * 1_000_000, 721, "720000000 bytes, unpacked"),
        (named(300), b"", 0, "200 columns"),
        (b"# " + b"x" * 200_000 + b"\nt_s,a\n", b"", 0, "100000 characters"),
        (b"t_s" + b",a" * 200_000, b"", 0, "100000 characters"),
    ],
)
def test_what_unpacks_to_more_than_a_run_is_refused_before_it_is_read(
    tmp_path: Path, head: bytes, piece: bytes, times: int, limit: str
) -> None:
    path = tmp_path / "run.csv.gz"
    _gzipped(path, head, piece, times)
    with pytest.raises(LogImportError) as refused:
        read_channels(path)
    assert refused.value.limit == limit


def test_a_gzip_that_is_cut_short_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "run.csv.gz"
    _gzipped(path, b"t_s,a\n", b"0,0\n" * 10_000, 3)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(LogImportError, match="cut short or damaged"):
        read_channels(path)


def test_a_parquet_file_of_too_many_rows_is_refused_from_its_footer(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table({"t_s": pa.array(np.zeros(1_800_001))}), path)
    with pytest.raises(LogImportError, match="at least 1800001 rows"):
        read_channels(path)


def test_an_import_is_bounded_as_a_diagnosis_is(tmp_path: Path) -> None:
    path = tmp_path / "run.csv.gz"
    _gzipped(path, b"t_s,a\n", b"0,0\n" * 100_000, 19)
    with pytest.raises(LogImportError, match="allowed: 1800000 rows; cut the run"):
        import_table(path, tmp_path / "run.mcap")
    pq.write_table(pa.table({f"a{k}": pa.array([0.0]) for k in range(201)}), tmp_path / "a.parquet")
    with pytest.raises(LogImportError, match="at least 201 columns; allowed: 200 columns"):
        import_table(tmp_path / "a.parquet", tmp_path / "run.mcap")


def test_runs_that_are_too_many_together_are_refused_with_the_one_too_many(tmp_path: Path) -> None:
    table = columns()
    names, values = list(table), list(table.values())
    together = Together(2 * len(names) * (N + 2))
    for k in range(2):
        read_channels(write(tmp_path / f"{k}.csv", names, values), together)
    one_more = write(tmp_path / "2.parquet", names, values)
    with pytest.raises(RunLogError, match=r"with .*2\.parquet the runs are more .*fewer runs"):
        read_channels(one_more, together)


def test_a_folder_of_runs_is_bounded_as_a_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from smad.checkup import files

    for k in range(3):
        table = {name: np.zeros(N) for name in ("duty_x", "duty_y", "force_N")}
        table |= {f"i_applied_{s}_A": np.zeros(N) for s in "xy"}
        table |= {"t_s": np.arange(N) * 0.01}
        write(tmp_path / f"{k}.csv", list(table), list(table.values()))
    assert len(files.read_folder(tmp_path)) == 3
    monkeypatch.setattr(files, "Together", lambda: Together(2 * 6 * (N + 2)))
    with pytest.raises(RunLogError, match="more than can be held at once"):
        files.read_folder(tmp_path)


def test_a_text_in_parquet_that_is_longer_than_any_number_is_refused_before_it_is_read(
    tmp_path: Path,
) -> None:
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table({"t_s": [1.0, 2.0], "force_N": ["1" * 2_000_000, "1"]}), path)
    with pytest.raises(LogImportError, match="'force_N' holds text too long for numbers"):
        read_channels(path)
    pq.write_table(pa.table({"t_s": [1.0, 2.0], "force_N": ["1.5", "2.5"]}), path)
    assert read_channels(path).columns["force_N"].tolist() == [1.5, 2.5]


def test_lists_in_a_column_of_a_parquet_file_are_refused_before_they_are_read(
    tmp_path: Path,
) -> None:
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table({"t_s": [0.0], "force_N": [[1.0, 2.0]]}), path)
    with pytest.raises(LogImportError, match=r"column 'force_N' is not a number; got list<"):
        read_channels(path)


READING = """
import sys
from pathlib import Path
from smad.records.channels import read_channels

def peak_B():
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith("VmHWM"))

read_channels(Path(sys.argv[1]))
before_B = peak_B()
read = read_channels(Path(sys.argv[2])).columns
print((peak_B() - before_B) / sum(v.nbytes for v in read.values()))
"""


@pytest.mark.parametrize("kind", ["csv.gz", "parquet"])
def test_reading_a_table_takes_little_more_memory_than_its_numbers(
    kind: str, tmp_path: Path
) -> None:
    rows = 600_000
    names = ["t_s", "force_N", *(f"{c}_{s}" for c in ("duty", "rtd", "v") for s in "xy")]
    names = [n + {"r": "_degC", "v": "_V"}.get(n[0], "") for n in names]
    big, small = tmp_path / f"big.{kind}", tmp_path / f"small.{kind}"
    if kind == "parquet":
        for path, n in ((big, rows), (small, 10)):
            write(path, names, [np.arange(n), *[np.ones(n)] * (len(names) - 1)])
    else:
        rest = ",1" * (len(names) - 1)
        for path, n in ((big, rows), (small, 10)):
            lines = "\n".join([",".join(names), *(f"{k}{rest}" for k in range(n))])
            path.write_bytes(gzip.compress(lines.encode(), 1))
    done = subprocess.run(
        [sys.executable, "-c", READING, str(small), str(big)],
        capture_output=True,
        text=True,
        check=True,
    )

    assert float(done.stdout) < MOST_TIMES


def test_a_unit_in_the_name_counts_where_the_mapping_gives_none(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("time_s,Way [cm]\n0,0.4\n1,0.5\n")
    name = "Way [cm]"

    def read(**rule: object) -> list[float]:
        mapping = MappingFile(columns={name: ColumnRule("displacement_mm", **rule)})
        return list(read_channels(file, mapping=mapping).columns["displacement_mm"])

    assert read() == [4.0, 5.0]
    assert read(column_unit="mm") == [0.4, 0.5]
    assert read(scale=10.0) == [4.0, 5.0]
    assert read(scale=-1.0) == [-4.0, -5.0]


def test_a_fraction_whose_name_says_percent_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_text("time_s,Pump X [%]\n0,0.4\n1,1.0\n")
    with pytest.raises(LogImportError, match="named %, and never above 1 %; got at most 1;"):
        read_channels(file)
    rule = ColumnRule("duty_x", "%")
    mapping = MappingFile(columns={"Pump X [%]": rule})
    assert list(read_channels(file, mapping=mapping).columns["duty_x"]) == [0.004, 0.01]


def test_an_import_onto_a_log_that_is_there_is_refused_before_the_table_is_read(
    tmp_path: Path,
) -> None:
    there = tmp_path / "run.mcap"
    there.write_bytes(b"")
    with pytest.raises(RunLogError, match="is there already"):
        import_table(tmp_path / "no such table.csv", there)


def test_a_table_without_a_channel_is_not_imported(tmp_path: Path) -> None:
    table = tmp_path / "other.csv"
    table.write_text("t_s,temp\n0,1\n1,2\n")
    with pytest.raises(LogImportError, match="no column that is a channel; got temp"):
        import_table(table, tmp_path / "other.mcap")
    assert not (tmp_path / "other.mcap").exists()


def test_what_is_neither_a_table_nor_a_run_log_is_told_the_kinds_that_are_read(
    tmp_path: Path,
) -> None:
    (tmp_path / "run.mat").write_bytes(b"MATLAB 5.0")
    with pytest.raises(LogImportError, match=r"run.mat is not a table; got .mat; allowed: .parq"):
        read_columns(tmp_path / "run.mat", None)
    (tmp_path / "run.mcap").write_bytes(b"MATLAB 5.0")
    with pytest.raises(RunLogError, match="is not a run log"):
        read_columns(tmp_path / "run.mcap", None)
