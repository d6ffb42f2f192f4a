"""What fuzzing found, told as what holds now. The inputs are in the corpus, named `found-…`."""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path

import lz4.frame
import pytest
from click.testing import CliRunner
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from campaign.fuzz.targets import TARGETS
from firmware_protocol.codec import CODEC
from firmware_protocol.description import ForeignCodec
from firmware_protocol.errors import SchemaError
from firmware_protocol.messages import Ident, State
from firmware_protocol.schema import decompress
from firmware_protocol.wire import fields_of
from sim_device.plant.errors import EffectError, ModelError, ParameterError
from sim_device.plant.models import read_model, save_model
from sim_device.plant.parameters import load_parameters, parameters_text
from smad.cli.log import log
from smad.errors import LogImportError
from smad.records.importer import import_table
from smad.runlog.header import RunHeader
from smad.runlog.mcap_file import CHANNEL_IDS, pack
from smad.runlog.overview import list_runs
from smad.runlog.reader import read_run
from smad.runlog.scan import Damage, scan
from smad.runlog.schema import ROW_TOPIC, Row
from smad.runlog.writer import write_run
from tests.firmware_protocol.pair import IDENT

DEEP = "[" * 3000


@pytest.mark.parametrize("text", [b"[" * 5000, b'{"messages":"\xce"}'])
def test_a_description_that_its_parser_gives_up_on_is_refused(text: bytes) -> None:
    with pytest.raises(SchemaError, match="cannot be read"):
        decompress(zlib.compress(text))


def test_a_board_cannot_make_its_host_hear_a_message_that_is_for_boards() -> None:
    setpoint = {"name": "SETPOINT", "number": State.info.number, "fields": []}
    ident = {"name": "STATE", "number": Ident.info.number, "fields": []}
    codec = ForeignCodec({"messages": [setpoint, ident]})
    assert not codec.knows(State.info.number)
    payload = CODEC.pack(IDENT)
    assert codec.unpack(Ident.info.number, payload) == IDENT


def model(tmp_path: Path, **keys: object) -> Path:
    path = tmp_path / "model.json"
    path.write_text(json.dumps({"format": "smad-model-1", **keys}))
    return path


@pytest.mark.parametrize("text", [f"title = {DEEP}", f"title = {'9' * 5000}"])
def test_a_parameter_file_that_its_parser_gives_up_on_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "parameters.toml"
    path.write_text(text)
    with pytest.raises(ParameterError, match=r"file: .*is not TOML"):
        load_parameters(path)


@pytest.mark.parametrize(("name", "text"), [("a.json", DEEP), ("a.toml", f"note = {DEEP}")])
def test_a_model_file_that_its_parser_gives_up_on_is_refused(
    tmp_path: Path, name: str, text: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ModelError, match="brackets"):
        read_model(tmp_path / name)


@pytest.mark.parametrize("base", ["x" * 5000, "a\0b", "/dev/zero"])
def test_a_base_that_cannot_be_a_file_is_refused_as_one_that_is_not_there(
    tmp_path: Path, base: str
) -> None:
    with pytest.raises(ParameterError, match="file:"):
        read_model(model(tmp_path, base=base))
    path = tmp_path / "parameters.toml"
    path.write_text(f"extends = {json.dumps(base)}")
    with pytest.raises(ParameterError, match="file:"):
        load_parameters(path)


def test_a_file_that_extends_itself_by_another_way_is_still_a_circle(tmp_path: Path) -> None:
    path = tmp_path / "parameters.toml"
    path.write_text(f'extends = "../{tmp_path.name}/parameters.toml"')
    with pytest.raises(ParameterError, match="extends itself"):
        load_parameters(path)


def test_a_number_beyond_all_floats_is_refused_as_infinite(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="not finite"):
        read_model(model(tmp_path, overrides={"density": 10**400}))
    with pytest.raises(EffectError, match="outside"):
        read_model(model(tmp_path, effects={"driver_gain": {"gain": 10**400}}))


@pytest.mark.parametrize("value", [{}, [], "0.1", "warm", True])
def test_an_effect_takes_numbers_only(tmp_path: Path, value: object) -> None:
    path = model(tmp_path, effects={"driver_gain": {"gain": value}})
    with pytest.raises(EffectError, match="driver_gain: gain is"):
        read_model(path)


def test_an_override_named_like_an_argument_is_an_unknown_parameter(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no such parameter"):
        read_model(model(tmp_path, overrides={"self": 1.0}))


@pytest.mark.parametrize("name", ["model.toml", "model.json"])
def test_a_note_in_any_language_comes_back(tmp_path: Path, name: str) -> None:
    note = 'one\ntwo\t"three" \\ 😀 \x7f'
    save_model(tmp_path / name, note=note)
    assert read_model(tmp_path / name).note == note


def test_half_a_character_is_refused_where_it_is_read(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="surrogates"):
        read_model(model(tmp_path, note="\ud800"))


def test_a_source_of_several_lines_survives_writing_the_parameters(tmp_path: Path) -> None:
    path = tmp_path / "parameters.toml"
    path.write_text(
        'extends = "set_a.toml"\n[coils]\nvalue = 12\nunit = "1"\nstatus = "assumed"\n'
        'range = [10, 14]\nsource = "one\\ntwo"\n'
    )
    parameters = load_parameters(path)
    path.write_text(parameters_text(parameters))
    assert load_parameters(path).entry("coils").source == "one\ntwo"


def test_a_column_that_is_no_text_is_told_before_a_bad_cell_of_another(
    tmp_path: Path,
) -> None:
    source = tmp_path / "run.csv"
    source.write_bytes(b"time_s,remark\n0,ok\nsoon,\x81")
    with pytest.raises(LogImportError, match="is not text"):
        import_table(source, tmp_path / "run.mcap")


def test_a_folder_is_listed_without_unpacking_what_a_damaged_footer_points_at(
    tmp_path: Path,
) -> None:
    damaged = TARGETS["runlog"].corpus()["found-footer-points-at-a-chunk"]
    (tmp_path / "run.mcap").write_bytes(damaged)
    (line,) = list_runs(tmp_path)
    assert line.rows is None
    assert line.problem == "cut short"


def test_a_log_whose_start_no_calendar_holds_is_still_shown_and_listed(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    write_run(path, RunHeader(started_unix_s=1e300), [Row(t_s=0.0)])
    for arguments in (["show", str(path)], ["list", "--folder", str(tmp_path)]):
        told = CliRunner().invoke(log, arguments)
        assert told.exit_code == 0
        assert "1e+300 s" in told.output


def test_a_time_beyond_all_clocks_is_imported_as_it_is(tmp_path: Path) -> None:
    source = tmp_path / "run.csv"
    source.write_text("time_s,displacement_mm\n-1e300,1\n0,2\n1e300,3\n")
    run = read_run(import_table(source, tmp_path / "run.mcap").path)
    assert run.columns["t_s"].tolist() == [-1e300, 0.0, 1e300]


def log_of(bodies: list[bytes], chunk: bytes = b"") -> bytes:
    channel = struct.pack("<HH", CHANNEL_IDS[Row], 0)
    for text in (ROW_TOPIC.encode(), b"json"):
        channel += struct.pack("<I", len(text)) + text
    channel += struct.pack("<I", 0)
    records = struct.pack("<BQ", Opcode.CHANNEL, len(channel)) + channel
    records += b"".join(pack(CHANNEL_IDS[Row], 0, 0, body).data for body in bodies)
    return MCAP0_MAGIC + records + chunk


def test_parts_of_torn_rows_never_add_up_to_a_row(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(log_of([b'{"t_s":1', b'"tick":3}', b'{"t_s":2},{"t_s":3}', b'{"t_s":4}']))
    run = read_run(path)
    assert run.columns["t_s"].tolist() == [4.0]
    assert any("3 messages left out: not of the schema" in note for note in run.notes)


def test_a_chunk_that_unpacks_to_more_than_it_claims_is_skipped(tmp_path: Path) -> None:
    packed = lz4.frame.compress(b"\0" * 50_000_000)
    body = struct.pack("<QQQII", 0, 0, 100, 0, 3) + b"lz4" + struct.pack("<Q", len(packed)) + packed
    path = tmp_path / "run.mcap"
    path.write_bytes(log_of([], struct.pack("<BQ", Opcode.CHUNK, len(body)) + body))
    damage = Damage()
    with path.open("rb") as file:
        list(scan(file, path.stat().st_size, damage))
    assert "100 bytes it claims" in damage.notes[0]


def test_the_fields_of_a_message_are_read_from_its_annotations_once() -> None:
    assert fields_of(State) is fields_of(State)
