"""Tables of one run that others made: CSV, gzipped CSV and Parquet, whole or not."""

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from smad.errors import LogImportError
from smad.runlog.importer import import_table
from smad.runlog.reader import read_run
from smad.runlog.tables import read_channels

N = 40


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


@pytest.mark.parametrize("name", ["a.parquet", "a.csv", "a.csv.gz"])
def test_a_table_of_any_kind_gives_the_same_channels(name: str, tmp_path: Path) -> None:
    table = columns()
    found = read_channels(write(tmp_path / name, list(table), list(table.values())))
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
    found = read_channels(path)
    assert found.keys() == table.keys()
    np.testing.assert_allclose(found["force_N"], table["force_N"])


@pytest.mark.parametrize("name", ["run.parquet", "run.csv.gz", "run.mat", "gone.csv"])
def test_a_file_that_cannot_be_read_is_one_sentence(name: str, tmp_path: Path) -> None:
    if not name.startswith("gone"):
        (tmp_path / name).write_bytes(b"nonsense")
    with pytest.raises(LogImportError, match=name.replace(".", r"\.")) as caught:
        read_channels(tmp_path / name)
    assert "\n" not in str(caught.value)


def _gzipped(path: Path, head: bytes, piece: bytes, times: int) -> None:
    with gzip.open(path, "wb", 1) as file:
        file.write(head)
        for _ in range(times):
            file.write(piece)


@pytest.mark.parametrize(
    ("head", "piece", "times", "limit"),
    [
        (b"t_s,a\n", b"0,0\n" * 100_000, 19, "1800000 rows"),
        (b"t_s" + b",a" * 60 + b"\n", b",".join([b"0"] * 61) + b"\n", 1_200_000, "72000000 cells"),
        (b"t_s,a\n", b"1" * 1_000_000, 721, "720000000 bytes, unpacked"),
        (b"t_s" + b",a" * 300 + b"\n", b"", 0, "200 columns"),
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
