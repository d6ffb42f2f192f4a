"""Out to other programs and back, and logs that were made elsewhere."""

import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_device.plant.units import UNITS
from smad.errors import LogImportError, RunLogError
from smad.records.channels import read_mapping
from smad.records.column_names import ALIASES
from smad.records.importer import import_table
from smad.records.units import convert
from smad.runlog.export import WRITERS, export_run
from smad.runlog.formats import FORMATS
from smad.runlog.reader import Run, read_run
from smad.runlog.schema import CHANNELS, LEGENDS, MISSING_INTEGER, Event

from .helpers import HEADER, write_small_run

GUIDE = Path(__file__).resolve().parents[3] / "docs" / "guide" / "run-logs.md"


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return read_run(write_small_run(tmp_path / "run.mcap", 200))


def imported(tmp_path: Path, text: str | bytes, mapping: str | None = None) -> Run:
    source = tmp_path / "elsewhere.csv"
    source.write_bytes(text if isinstance(text, bytes) else text.encode())
    rules = None
    if mapping is not None:
        (tmp_path / "mapping.toml").write_text(mapping)
        rules = read_mapping(tmp_path / "mapping.toml")
    target = tmp_path / "elsewhere.mcap"
    target.unlink(missing_ok=True)
    return read_run(import_table(source, target, rules).path)


def refusal(tmp_path: Path, text: str | bytes, mapping: str | None = None) -> str:
    with pytest.raises(LogImportError) as caught:
        imported(tmp_path, text, mapping)
    assert not (tmp_path / "elsewhere.mcap").exists()
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_table_comes_back_as_the_run_it_was_made_from(
    tmp_path: Path, run: Run, suffix: str
) -> None:
    export_run(run, tmp_path / f"out{suffix}")
    back = read_run(import_table(tmp_path / f"out{suffix}", tmp_path / "back.mcap").path)
    for name, column in run.columns.items():
        np.testing.assert_array_equal(back.columns[name], column, err_msg=name)
    assert back.events == run.events
    assert back.link == run.link
    assert back.header.source == "import"
    assert back.header.extra["imported_source"] == "sim"
    kept = ("name", "configuration", "parameter_file", "gains", "seed", "board", "notes")
    for name in kept:
        assert getattr(back.header, name) == getattr(HEADER, name)


def test_a_csv_has_plain_names_and_empty_cells_for_what_was_not_measured(
    tmp_path: Path, run: Run
) -> None:
    faults = run.columns["faults"].copy()
    faults[0] = MISSING_INTEGER
    export_run(replace(run, columns={**run.columns, "faults": faults}), tmp_path / "out.csv")
    names, first = (tmp_path / "out.csv").read_text().splitlines()[:2]
    assert names.split(",")[:3] == ["t_s", "host_time_s", "tick"]
    assert "stage_mm" not in names
    cells = dict(zip(names.split(","), first.split(","), strict=True))
    assert (cells["displacement_mm"], cells["faults"], cells["mode"]) == ("", "", "2")


def test_what_numbers_stand_for_goes_with_them(tmp_path: Path, run: Run) -> None:
    from pyarrow import parquet
    from scipy.io import loadmat

    export_run(run, tmp_path / "out.parquet")
    legend = parquet.read_schema(tmp_path / "out.parquet").field("mode").metadata[b"legend"]
    assert msgspec.json.decode(legend, type=dict[int, str]) == LEGENDS["mode"]
    export_run(run, tmp_path / "out.mat")
    legends = loadmat(tmp_path / "out.mat", simplify_cells=True)["run"]["legends"]
    words = dict(zip(legends["mode"]["numbers"], legends["mode"]["words"], strict=True))
    assert words == LEGENDS["mode"]
    assert list(legends) == ["mode"]


def test_a_parquet_file_keeps_numbers_types_units_and_header(tmp_path: Path, run: Run) -> None:
    from pyarrow import parquet

    export_run(run, tmp_path / "out.parquet")
    table = parquet.read_table(tmp_path / "out.parquet")
    assert table.schema.field("rtd_x_degC").metadata == {b"unit": b"degC"}
    assert msgspec.json.decode(table.schema.metadata[b"smad"])["header"]["seed"] == 7
    np.testing.assert_array_equal(table["faults"].to_numpy(), run.columns["faults"])
    assert table["displacement_mm"].null_count == np.isnan(run.columns["displacement_mm"]).sum()


def test_a_parquet_file_with_more_metadata_than_is_read_lacks_the_data_of_events_and_says_so(
    tmp_path: Path, run: Run
) -> None:
    from pyarrow import parquet

    uploads = [Event(kind="command", text="move", data={"t_s": "0" * 1_000_000})] * 90
    export_run(replace(run, events=uploads), tmp_path / "out.parquet")
    document = msgspec.json.decode(
        parquet.read_table(tmp_path / "out.parquet").schema.metadata[b"smad"]
    )
    assert [event["text"] for event in document["events"]] == ["move"] * 90
    assert document["link"]
    assert "the data of events left out of out.parquet" in document["notes"][-1]


def test_a_matlab_file_has_columns_units_and_header_under_valid_names(
    tmp_path: Path, run: Run
) -> None:
    from scipy.io import loadmat

    export_run(run, tmp_path / "out.mat")
    content = loadmat(tmp_path / "out.mat", simplify_cells=True)["run"]
    for name in content["columns"]:
        assert name.isidentifier()
        assert len(name) <= 63
        np.testing.assert_array_equal(content["columns"][name], run.columns[name])
    assert content["units"]["rtd_x_degC"] == "degC"
    assert content["header"]["seed"] == 7
    assert msgspec.json.decode(content["header"]["gains"]) == HEADER.gains
    assert msgspec.json.decode(content["events"])[1]["text"] == "too hot"


def test_octave_reads_the_events_of_a_matlab_file_whatever_their_letters(
    tmp_path: Path, run: Run
) -> None:
    from scipy.io import loadmat

    run.events.append(Event(t_s=3.0, kind="state", text="ARMED → SAFE"))
    export_run(run, tmp_path / "out.mat")
    events = loadmat(tmp_path / "out.mat", simplify_cells=True)["run"]["events"]
    # Octave's letters are bytes: another encoding of them is no JSON.
    assert events.isascii()
    assert msgspec.json.decode(events)[-1]["text"] == "ARMED → SAFE"


def test_every_format_can_be_asked_for_and_is_in_the_guide() -> None:
    assert (*(suffix[1:] for suffix in WRITERS), "rosbag2", "lerobot") == FORMATS
    guide = GUIDE.read_text()
    assert [suffix for suffix in WRITERS if f"| `{suffix}` |" not in guide] == []


@pytest.mark.parametrize("suffix", WRITERS)
def test_an_export_overwrites_only_when_told_to(tmp_path: Path, run: Run, suffix: str) -> None:
    target = tmp_path / f"out{suffix}"
    target.write_text("mine")
    with pytest.raises(RunLogError, match="is there already"):
        export_run(run, target)
    assert target.read_text() == "mine"
    export_run(run, target, overwrite=True)
    assert target.read_bytes() != b"mine"
    assert not list(tmp_path.glob(".*"))


def test_an_unknown_format_is_refused_with_those_known(tmp_path: Path, run: Run) -> None:
    with pytest.raises(RunLogError, match=re.escape(f"got .xlsx; allowed: {' '.join(WRITERS)}")):
        export_run(run, tmp_path / "out.xlsx")


def test_a_run_without_rows_is_not_exported(tmp_path: Path) -> None:
    empty = read_run(write_small_run(tmp_path / "empty.mcap", 0))
    with pytest.raises(RunLogError, match="holds no rows"):
        export_run(empty, tmp_path / "out.csv")


def test_units_in_the_names_are_converted(tmp_path: Path) -> None:
    run = imported(
        tmp_path,
        "time_ms,temp_x_degC,T_y_K,displacement_m,force_mN,current_x_mA,pump_y_pct,"
        "Angle [rad],why\n"
        "0,20.5,300.15,0.0105,1500,250,50,0.5,a\n"
        "10,21.5,,0.0110,1600,260,100,0.6,b\n",
    )
    assert run.columns["t_s"].tolist() == [0.0, 0.01]
    assert run.columns["rtd_x_degC"].tolist() == [20.5, 21.5]
    np.testing.assert_allclose(run.columns["rtd_y_degC"], [27.0, np.nan], atol=1e-9)
    np.testing.assert_allclose(run.columns["displacement_mm"], [10.5, 11.0])
    np.testing.assert_allclose(run.columns["force_N"], [1.5, 1.6])
    np.testing.assert_allclose(run.columns["i_meas_x_A"], [0.25, 0.26])
    np.testing.assert_allclose(run.columns["duty_y"], [0.5, 1.0])
    np.testing.assert_allclose(run.columns["angle_deg"], np.degrees([0.5, 0.6]))
    assert run.header.rate_hz == 100.0
    assert run.header.extra["ignored_columns"] == "why"


def test_missing_channels_are_null_and_listed(tmp_path: Path) -> None:
    source = tmp_path / "elsewhere.csv"
    source.write_text("t_s,x_mm\n0,1\n1,2\n")
    done = import_table(source, tmp_path / "elsewhere.mcap")
    assert done.channel_of == {"t_s": "t_s", "x_mm": "displacement_mm"}
    assert set(done.missing) == set(CHANNELS) - {"t_s", "displacement_mm"}
    assert set(read_run(done.path).missing) == set(done.missing)


def test_a_mapping_file_says_what_other_names_mean(tmp_path: Path) -> None:
    run = imported(
        tmp_path,
        "# logger 3\nZeit;Oben;Weg\n0,0;1,5;10\n0,5;2,5;20\n",
        """
        [csv]
        delimiter = ";"
        decimal = ","
        [columns."Zeit"]
        channel = "t_s"
        column_unit = "min"
        [columns."Oben"]
        channel = "rtd_x_degC"
        column_unit = "K"
        scale = 100.0
        offset = 150.0
        [columns."Weg"]
        channel = "displacement_mm"
        scale = -1.0
        """,
    )
    assert run.columns["t_s"].tolist() == [0.0, 30.0]
    np.testing.assert_allclose(run.columns["rtd_x_degC"], [300 - 273.15, 400 - 273.15])
    assert run.columns["displacement_mm"].tolist() == [-10.0, -20.0]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("", ["is empty"]),
        ("# only\n# comments\n", ["is empty"]),
        ("t_s,x_mm\n", ["holds no rows"]),
        ("x_mm,force_N\n1,2\n", ["no time column", "x_mm, force_N"]),
        ("t_s,x_mm\n1,1\n2,1\n\n1.5,1\n", ["line 5", "1.5 s after 2 s"]),
        ("t_s,x_mm\n1,1\n1,1\n", ["line 3", "does not increase"]),
        ("t_s,x_mm\n1,1\n,1\n", ["line 3", "'t_s' holds no number"]),
        ("t_s,x_mm\n1,1\nInf,1\n", ["line 3", "'t_s' holds inf"]),
        ("t_s,x_furlong\n1,2\n", ["'furlong' is not a unit", "mm", "x_mm"]),
        ("t_s,temp_x_Q\n1,2\n", ["'Q' is not a unit", "degC"]),
        ("t_s,force\n1,2\n", ["unit is missing", "force_N"]),
        ("t_s,x_mm\n1,2\n2,abc\n", ["line 3", "'x_mm'", "abc"]),
        ("# a\n\nt_s,x_mm\n1,2\n\n2,3.5.1\n", ["line 6", "3.5.1"]),
        ("t_s;x_mm\n1;2,5\n", ["line 2", "2,5", "decimal"]),
        ("t_s,x_mm\n1,2\n3\n", ["line 3 has 1 cell, not 2"]),
        ("t_s,x_mm,x_m\n1,2,3\n", ["'x_mm'", "'x_m'", "both displacement_mm"]),
        ("t_s,t_s\n1,2\n", ["line 1", "two columns are named 't_s'"]),
        ("t_s,faults\n1,0.5\n", ["line 2", "whole numbers", "0.5"]),
        ("t_s,mode\n1,-2\n", ["line 2", "whole numbers", "-2"]),
        (b"\xff\xfe\x00\x01", ["no time column"]),
        (b"t_s,x_mm\n1,\xff\n", ["line 2", "'x_mm' is not a number", "ÿ"]),
    ],
)
def test_a_csv_that_cannot_be_used_is_refused_with_place_and_value(
    tmp_path: Path, text: str | bytes, names: list[str]
) -> None:
    message = refusal(tmp_path, text)
    for name in names:
        assert name in message


@pytest.mark.parametrize(
    ("mapping", "names"),
    [
        ('[columns."a"]\nchannel = "t_s"', ["column 'a'", "does not have"]),
        ('[columns."t"]\nchannel = "t_min"', ["unknown channel", "t_min", "t_s"]),
        ('[columns."t"]\nchannel = "t_s"\ncolumn_unit = "mm"', ["unknown unit", "got mm", "ms"]),
        ('[columns."t"]\nchannel = "t_s"\nscale = nan', ["not valid", "scale"]),
        ('[columns."t"]\nchanel = "t_s"', ["not valid", "chanel"]),
        ('[csv]\ndelimiter = "|"', ["not valid", "csv.delimiter"]),
        ("= 3", ["not valid"]),
    ],
)
def test_a_mapping_that_cannot_be_used_is_refused(
    tmp_path: Path, mapping: str, names: list[str]
) -> None:
    message = refusal(tmp_path, "t,x_mm\n1,2\n", mapping)
    for name in names:
        assert name in message


def test_files_that_are_not_there_are_refused(tmp_path: Path) -> None:
    with pytest.raises(LogImportError, match="cannot read"):
        import_table(tmp_path / "nothing.csv", tmp_path / "out.mcap")
    with pytest.raises(LogImportError, match="cannot read mapping"):
        read_mapping(tmp_path / "nothing.toml")


def test_a_header_beside_the_csv_that_is_no_header_is_refused(tmp_path: Path) -> None:
    (tmp_path / "elsewhere.header.json").write_text('{"events": 3}')
    assert "elsewhere.header.json is not the header" in refusal(tmp_path, "t_s,x_mm\n1,2\n")


def test_an_import_never_overwrites_a_log(tmp_path: Path) -> None:
    target = write_small_run(tmp_path / "out.mcap", 5)
    before = target.read_bytes()
    (tmp_path / "a.csv").write_text("t_s,x_mm\n1,2\n")
    with pytest.raises(RunLogError, match="is there already"):
        import_table(tmp_path / "a.csv", target)
    assert target.read_bytes() == before


@pytest.mark.parametrize(("stem", "channel"), ALIASES.items())
def test_every_alias_leads_to_a_channel_and_its_unit_is_known(stem: str, channel: str) -> None:
    assert stem == stem.lower()
    assert CHANNELS[channel].unit in UNITS


@pytest.mark.parametrize(
    ("value", "unit", "to", "expected"),
    [
        (300.0, "K", "degC", 26.85),
        (212.0, "degF", "degC", 100.0),
        (2685.0, "cC", "degC", 26.85),
        (1.0, "in", "mm", 25.4),
        (2.0, "min", "s", 120.0),
        (2.0, "h", "min", 120.0),
        (1.0, "kgf", "N", 9.80665),
        (1.0, "lbf", "kgf", 0.45359237),
        (1000.0, "gf", "kgf", 1.0),
        (1.0, "psi", "Pa", 6894.757293168),
        (10.0, "rpm", "deg/s", 60.0),
        (1.0, "rev", "rad", 2.0 * np.pi),
        (1.0, "uOhm m", "Ohm m", 1e-6),
        (1.0, "mm3/s", "m3/s", 1e-9),
        (250.0, "mA", "A", 0.25),
        (50.0, "pct", "1", 0.5),
    ],
)
def test_a_unit_is_converted(value: float, unit: str, to: str, expected: float) -> None:
    assert convert(np.array([value]), unit, to)[0] == pytest.approx(expected, rel=1e-9)


def test_a_unit_of_another_quantity_is_refused() -> None:
    with pytest.raises(LogImportError, match="mm is not a unit for a value in s"):
        convert(np.array([1.0]), "mm", "s")


CELL = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False, width=32).map(repr),
    st.text(st.characters(codec="utf-8"), max_size=4),
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    names=st.lists(st.sampled_from(["t_s", "x_mm", "T_x_K", "mode", "a", "force", ""]), max_size=4),
    rows=st.lists(st.lists(CELL, max_size=4), max_size=4),
    delimiter=st.sampled_from(",;\t"),
)
def test_any_table_is_imported_or_refused_in_one_line(
    tmp_path_factory: pytest.TempPathFactory,
    names: list[str],
    rows: list[list[str]],
    delimiter: str,
) -> None:
    folder = tmp_path_factory.mktemp("csv")
    source = folder / "a.csv"
    lines = [delimiter.join(names), *(delimiter.join(cells) for cells in rows)]
    source.write_text("\n".join(lines), encoding="utf-8", newline="")
    try:
        done = import_table(source, folder / "a.mcap")
    except LogImportError as error:
        check_one_line(error)
    else:
        assert len(read_run(done.path)) == done.rows > 0


def check_one_line(error: RunLogError) -> None:
    assert len(str(error).splitlines()) == 1
