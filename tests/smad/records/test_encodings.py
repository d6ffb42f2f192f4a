"""Text of tables that is not UTF-8: read as what it is likely to be, which is said, or refused."""

import codecs
import gzip
from pathlib import Path

import pytest

from smad.errors import LogImportError
from smad.records.channels import MappingFile, read_channels
from smad.records.csv_table import CsvFormat
from smad.records.importer import import_table

TEXT = "Prüfstand 3\nZeit [s];Temp X [°C];i_x (µA)\n0;22,5;1500\n0,1;22,6;1600\n"
RULES = MappingFile(CsvFormat(decimal=","), {})


def written(path: Path, encoding: str, mark: bytes = b"") -> Path:
    text = TEXT.replace("Zeit", "time").encode(encoding)
    path.write_bytes(gzip.compress(mark + text) if path.suffix == ".gz" else mark + text)
    return path


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz"])
@pytest.mark.parametrize("encoding", ["cp1252", "latin-1", "cp1250"])
def test_a_table_of_a_windows_program_is_read_and_said_to_be_no_utf_8(
    encoding: str, name: str, tmp_path: Path
) -> None:
    read = read_channels(written(tmp_path / name, encoding), mapping=RULES)
    assert read.columns["rtd_x_degC"].tolist() == [22.5, 22.6]
    assert read.columns["i_meas_x_A"].tolist() == pytest.approx([1.5e-3, 1.6e-3])
    assert "it is no UTF-8: its names are read as cp1252" in read.notes


def test_utf_16_is_known_by_its_mark_and_utf_8_needs_none(tmp_path: Path) -> None:
    for encoding, mark in (
        ("utf-16-le", codecs.BOM_UTF16_LE), ("utf-8", b""), ("utf-8", codecs.BOM_UTF8),
    ):  # fmt: skip
        read = read_channels(written(tmp_path / "a.csv", encoding, mark), mapping=RULES)
        assert read.columns["rtd_x_degC"].tolist() == [22.5, 22.6]
        assert not any("UTF-8" in note for note in read.notes)


def test_an_encoding_that_is_declared_is_taken_without_a_word(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes("時刻 [s],temp_x_degC\n0,22.5\n1,22.6\n".encode("shift_jis"))
    (tmp_path / "map.toml").write_text(
        '[csv]\nencoding = "shift_jis"\n[columns."時刻 [s]"]\nchannel = "t_s"\n', encoding="utf-8"
    )
    from smad.records.channels import read_mapping

    imported = import_table(path, tmp_path / "a.mcap", read_mapping(tmp_path / "map.toml"))
    assert imported.rows == 2
    assert not imported.notes


def test_what_is_no_text_or_of_an_unknown_encoding_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(b"t_s,\x81\x8d\n0,1\n")
    with pytest.raises(LogImportError, match=r'is not text: .*`encoding = "…"` under \[csv\]'):
        read_channels(path)
    with pytest.raises(LogImportError, match="encoding is not known; got klingon; allowed: those"):
        read_channels(path, mapping=MappingFile(CsvFormat(encoding="klingon")))
