"""Heads of CSV files as spreadsheets and loggers write them, and numbers of other countries."""

from pathlib import Path

import numpy as np
import pytest

from smad.errors import LogImportError
from smad.records.channels import (
    Channels,
    MappingFile,
    channels_of,
    hold_last_value,
    read_mapping,
)
from smad.records.column_names import ColumnRule
from smad.records.csv_table import CsvFormat
from smad.records.tables import left_out, open_table
from smad.simulators.columns import tables_of


def read(folder: Path, text: str | bytes, **form: str) -> Channels:
    path = folder / "a.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return channels_of(open_table(path, CsvFormat(**form)))  # type: ignore[arg-type]


ROWS = "0,20.5\n1,21.5\n"


@pytest.mark.parametrize(
    "text",
    [
        "t_s,temp_x_degC\n" + ROWS,
        "\ufefft_s,temp_x_degC\r\n" + ROWS.replace("\n", "\r\n"),
        "# t_s,temp_x_degC\n" + ROWS,
        "% logger 7\n% t_s, temp_x_degC\n" + ROWS,
        "# t_s temp_x_degC\n" + ROWS.replace(",", " "),
        "sep=;\nt_s;temp_x_degC\n" + ROWS.replace(",", ";"),
        '"sep=,"\nt_s,temp_x_degC\n' + ROWS,
        "Run 3, a warm day\n\nt_s\ttemp_x_degC\n" + ROWS.replace(",", "\t"),
        "Measured by Ada\nt_s,temp_x_degC\n" + ROWS,
        '"t_s", "temp_x_degC"\n' + ROWS,
        '"Time (s)","Temperature X (°C)"\n' + ROWS,
        "time s,temp x degC\n" + ROWS,
        "Time,Temperature X\ns,°C\n" + ROWS,
        "Time,Temperature X\n[s],[°C]\n" + ROWS,
        "Channel A,Channel B\nt_s,temp_x_degC\n" + ROWS,
        "Run 3, a warm day\nTime,Temperature X\ns,°C\n" + ROWS,
        "Time;Temperature X\nsec;deg C\n" + ROWS.replace("\n", ";\n").replace(",", ";"),
        "A\nTime\tTemperature X\tComment\ns\t°C\t\n" + ROWS.replace(",", "\t"),
    ],
)
def test_names_are_found_wherever_they_stand(text: str, tmp_path: Path) -> None:
    found = read(tmp_path, text)
    assert found.columns["t_s"].tolist() == [0.0, 1.0]
    assert found.columns["rtd_x_degC"].tolist() == [20.5, 21.5]


def test_a_title_that_was_passed_over_is_told(tmp_path: Path) -> None:
    found = read(tmp_path, "Measured by Ada\nt_s,temp_x_degC\n" + ROWS)
    assert found.notes == ("line 1 is not a line of names: Measured by Ada",)


@pytest.mark.parametrize("row", ["s,mA,1,Counts", "s,mA,1,-"])
def test_a_row_of_units_may_hold_a_one_or_a_word_that_is_none(row: str, tmp_path: Path) -> None:
    found = read(tmp_path, f"Time,Current X,Pump X,Tick\n{row}\n0,1,1,7\n1,2,1,8\n")
    assert found.columns["i_meas_x_A"].tolist() == [0.001, 0.002]


@pytest.mark.parametrize("unit", ["1", "-", "–"])
def test_a_dash_in_place_of_a_unit_is_a_plain_number(unit: str, tmp_path: Path) -> None:
    row = read(tmp_path, f"Time,Current X,Pump X\ns,mA,{unit}\n0,1,0.2\n1,2,0.4\n")
    assert row.columns["duty_x"].tolist() == [0.2, 0.4]
    name = read(tmp_path, f"Time [s],Pump X [{unit}]\n0,0.2\n1,0.4\n")
    assert name.columns["duty_x"].tolist() == [0.2, 0.4]


def test_a_row_of_units_may_repeat_those_of_the_names(tmp_path: Path) -> None:
    found = read(tmp_path, "t_s,temp_x_degC,i_meas_x_A\ns,C,A\n0,20.5,1\n1,21.5,2\n")
    assert found.columns["t_s"].tolist() == [0.0, 1.0]
    assert found.columns["rtd_x_degC"].tolist() == [20.5, 21.5]
    assert found.columns["i_meas_x_A"].tolist() == [1.0, 2.0]


def test_a_row_of_units_that_contradicts_a_name_leaves_the_column_out(tmp_path: Path) -> None:
    found = read(tmp_path, "t_s,temp_x_degC,i_meas_x_A\ns,K,A\n0,20.5,1\n1,21.5,2\n")
    assert found.assignment.ignored == ["temp_x_degC [K]"]


STAMPS = {
    "": ("2026-11-26T13:45:59.750", "2026-11-26 13:46:00,250", "2026-11-26T14:46:01Z"),
    "%d.%m.%Y %H:%M:%S,%f": ("26.11.2026 13:45:59,750", "26.11.2026 13:46:00,250",
                             "26.11.2026 14:46:01,000"),
    "%m/%d/%Y %I:%M:%S.%f %p": ("11/26/2026 1:45:59.75 PM", "11/26/2026 1:46:00.25 PM",
                                "11/26/2026 2:46:01.00 PM"),
}  # fmt: skip


@pytest.mark.parametrize("name", ["Zeit", "timestamp", ""])
@pytest.mark.parametrize("form", STAMPS)
def test_stamps_below_a_title_are_the_time(form: str, name: str, tmp_path: Path) -> None:
    rows = "".join(f"{stamp};2{k}\n" for k, stamp in enumerate(STAMPS[form]))
    text = f"Messung 5\n{name};temp_x_degC\n{rows}"
    found = read(tmp_path, text, time_format=form)
    assert found.columns["t_s"].tolist() == [0.0, 0.5, 3601.25]
    assert found.notes[-1] == f"the time is column {name!r}, in s since its first stamp"
    if form:
        with pytest.raises(LogImportError) as refused:
            read(tmp_path, text)
        assert f'say `time_format = "{form}"' in str(refused.value)


def test_a_stamp_among_numbers_of_a_named_time_is_told_with_its_form(tmp_path: Path) -> None:
    with pytest.raises(LogImportError, match=r'line 3.*got 0:00:01; .*`time_format = "%H:%M:%S"`'):
        read(tmp_path, "time_s,temp_x_degC\n0,22\n0:00:01,23\n")


def test_a_unit_that_is_given_to_stamps_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Zeit,temp_x_degC\n2026-11-26 13:45:01,22\n2026-11-26 13:46:01,23\n")

    def times(**rule: str) -> list[float]:
        rules = {"Zeit": ColumnRule("t_s", **rule)}
        return list(channels_of(open_table(path), MappingFile(columns=rules)).columns["t_s"])

    assert times() == times(column_unit="s") == [0.0, 60.0]
    with pytest.raises(LogImportError, match="holds stamps, which are read in s; got min"):
        times(column_unit="min")


def test_the_time_of_a_simulator_may_be_stamps_whatever_their_name(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("Zeit [ms],T_degC\n2026-11-26 13:45:01,22\n2026-11-26 13:46:01,23\n")
    (table,) = tables_of(path)
    assert table.t_s.tolist() == [0.0, 60.0]


def test_stamps_of_whole_seconds_at_ten_rows_a_second_want_more_digits(tmp_path: Path) -> None:
    rows = "".join(f"2026-11-26 13:45:0{k // 5},22\n" for k in range(20))
    with pytest.raises(LogImportError, match="write it with more digits"):
        read(tmp_path, f"Time,temp_x_degC\n{rows}")


def test_a_wrong_key_is_told_with_those_that_are_allowed(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text('[csv]\ndelimeter = ";"\n')
    with pytest.raises(LogImportError, match=r"allowed: delimiter, .*time_format; did you mean"):
        read_mapping(tmp_path / "m.toml")


def test_a_column_without_a_name_is_told_so() -> None:
    assert left_out(["", "b"]) == ("columns left out: one without a name, b",)


def test_a_file_without_names_is_refused_with_its_first_numbers(tmp_path: Path) -> None:
    with pytest.raises(LogImportError, match=r"line 2: numbers stand where the names.*got 0,20\.5"):
        read(tmp_path, "# of channel 3\n" + ROWS)


@pytest.mark.parametrize("name", ["LOG00001.CSV", "a.Csv", "b.PARQUET", "c.CSV.GZ"])
def test_the_name_of_a_table_may_be_in_capital_letters(name: str, tmp_path: Path) -> None:
    import gzip

    import pyarrow as pa
    import pyarrow.parquet as pq

    path, text = tmp_path / name, f"t_s,temp_x_degC\n{ROWS}".encode()
    if name.endswith("PARQUET"):
        pq.write_table(pa.table({"t_s": [0.0, 1.0], "temp_x_degC": [20.5, 21.5]}), path)
    else:
        path.write_bytes(gzip.compress(text) if name.endswith("GZ") else text)
    assert channels_of(open_table(path)).columns["rtd_x_degC"].tolist() == [20.5, 21.5]


GERMAN = "t_s;current_x_mA\n0,5;850,5\n1,0;1.500\n"


def test_a_point_among_commas_is_refused_until_it_is_said_what_it_is(tmp_path: Path) -> None:
    with pytest.raises(LogImportError) as refused:
        read(tmp_path, GERMAN, decimal=",")
    assert "line 3: column 'current_x_mA' is not a number; got 1.500" in str(refused.value)
    assert 'say `thousands = "."` under [csv]' in str(refused.value)
    found = read(tmp_path, GERMAN, decimal=",", thousands=".")
    np.testing.assert_allclose(found.columns["i_meas_x_A"], [0.8505, 1.5])


@pytest.mark.parametrize("cell", ["1.5", "1.50", "12.3456", "1.500.00", ".500"])
def test_a_sign_that_groups_no_thousands_is_refused(cell: str, tmp_path: Path) -> None:
    with pytest.raises(LogImportError, match="is not a number"):
        read(tmp_path, f"t_s;current_x_mA\n0;{cell}\n", decimal=",", thousands=".")


def test_thousands_may_be_grouped_by_commas_and_blanks(tmp_path: Path) -> None:
    text = 't_s;current_x_mA\n0;"1,500.5"\n'
    assert read(tmp_path, text, thousands=",").columns["i_meas_x_A"].tolist() == [1.5005]
    text = "t_s;current_x_mA\n0;1 500\n"
    assert read(tmp_path, text, thousands=" ").columns["i_meas_x_A"].tolist() == [1.5]
    with pytest.raises(LogImportError, match="thousands and decimals have one sign"):
        read(tmp_path, text, decimal=",", thousands=",")


def test_a_number_in_force_until_the_next_one_is_held() -> None:
    column = np.array([np.nan, 3.0, np.nan, np.nan, 5.0, np.nan])
    np.testing.assert_array_equal(hold_last_value(column), [np.nan, 3.0, 3.0, 3.0, 5.0, 5.0])


def test_inputs_that_act_after_their_row_are_those_of_the_next_interval(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text('inputs_act = "after"\n')
    (tmp_path / "a.csv").write_text(
        "time_s,i_cmd_x_A,duty_x,drain_x,temp_x_degC\n0,1,0,0,20\n1,2,0.5,1,21\n2,3,1,0,22\n"
    )
    found = channels_of(open_table(tmp_path / "a.csv"), read_mapping(tmp_path / "m.toml")).columns
    assert found["i_cmd_x_A"].tolist() == [1.0, 1.0, 2.0]
    assert found["duty_x"].tolist() == [0.0, 0.0, 0.5]
    assert found["drain_x"].tolist() == [0.0, 0.0, 1.0]
    assert found["rtd_x_degC"].tolist() == [20.0, 21.0, 22.0]
    (tmp_path / "m.toml").write_text('inputs_act = "next"\n')
    with pytest.raises(LogImportError, match="inputs_act"):
        read_mapping(tmp_path / "m.toml")
