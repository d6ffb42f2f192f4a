"""The table of channels, and what is made from it."""

import json
from typing import Any

import msgspec
import pytest

from firmware_protocol.enums import BoardState, Limiter, ValidBit
from firmware_protocol.messages import State
from sim_device.plant.units import UNITS
from smad.config.axes import DEGREES_PER_MM
from smad.control.sample import Scales, sample_of
from smad.control.setpoint import Output, setpoint_of
from smad.runlog.header import RunHeader, installed_versions
from smad.runlog.pack import RecordPacker
from smad.runlog.rows import row_of
from smad.runlog.schema import CHANNELS, TOPICS, Event, LinkSample, Row, json_schema

from .helpers import HEADER


@pytest.mark.parametrize("channel", CHANNELS.values(), ids=lambda c: c.name)
def test_every_channel_has_a_description_a_source_and_its_unit_in_its_name(channel) -> None:
    assert channel.description
    assert channel.source
    if channel.kind == "float" and channel.unit != "1":
        assert channel.unit in UNITS
        assert channel.name.endswith(f"_{channel.unit}")


PLAIN = {"boolean", "string", "number", "integer"}


def refused_by_viewers(schema: dict[str, Any], where: str = "message") -> list[str]:
    """Why Lichtblick's `parseJsonSchema` (and Foxglove's) would refuse the topic."""
    if schema.get("type") != "object":
        return [f"{where}: type {schema.get('type')!r} instead of object"]
    if "properties" not in schema:
        return [f"{where}: an object without properties"]
    found = []
    for name, member in schema["properties"].items():
        inner = member["items"] if member.get("type") == "array" else member
        kind = inner.get("type")
        if kind == "object":
            found += refused_by_viewers(inner, f"{where}.{name}")
        elif not (isinstance(kind, str) and kind in PLAIN) or "contentEncoding" in inner:
            found.append(f"{where}.{name}: type {kind!r}")
    return found


@pytest.mark.parametrize("record", TOPICS, ids=lambda r: r.__name__)
def test_viewers_take_the_json_schema_and_every_member_is_described(record) -> None:
    schema = json.loads(json_schema(record))
    assert refused_by_viewers(schema) == []
    assert set(schema["properties"]) == set(record.__struct_fields__)
    for member in schema["properties"].values():
        assert member["description"]
        assert member.get("default", {}) is not None


def test_what_viewers_refuse_is_told() -> None:
    members = {"a": {"type": ["number", "null"]}, "b": {"enum": ["x"]}, "c": {"type": "object"}}
    refused = refused_by_viewers({"type": "object", "properties": members})
    assert [line.partition(":")[0] for line in refused] == ["message.a", "message.b", "message.c"]


def test_a_value_that_was_not_measured_is_absent() -> None:
    for row in (Row(t_s=1.0), Row(t_s=1.0, force_N=float("nan")), Row(t_s=1.0, force_N=None)):
        assert RecordPacker(0.0).pack(row)[-1].endswith(b'{"t_s":1.0}')


def test_events_and_link_samples_keep_their_details() -> None:
    event = Event(kind="note", text="x", data={"a": [1, None]})
    link = LinkSample(counters={"retries": 2.0})
    assert msgspec.json.decode(msgspec.json.encode(event), type=Event) == event
    assert msgspec.json.decode(msgspec.json.encode(link), type=LinkSample) == link


def test_a_header_comes_back_from_its_metadata() -> None:
    assert RunHeader.from_metadata(HEADER.to_metadata()) == HEADER


def test_a_header_names_the_hash_of_its_parameter_file() -> None:
    assert len(HEADER.to_metadata()["parameter_sha256"]) == 64
    assert RunHeader().to_metadata()["parameter_sha256"] == ""


def test_metadata_of_another_program_is_kept_and_nonsense_does_no_harm() -> None:
    header = RunHeader.from_metadata(
        {"operator": "somebody", "seed": "not a number", "source": "elsewhere", "gains": "[1]"}
    )
    assert header.seed is None
    assert header.source == "unknown"
    assert header.extra == {
        "operator": "somebody",
        "seed": "not a number",
        "source": "elsewhere",
        "gains": "[1]",
    }


def test_the_versions_of_a_run_are_those_installed() -> None:
    assert installed_versions()["smad"]
    assert installed_versions()["mcap"] != "not installed"


def test_a_row_has_in_each_channel_what_the_board_and_the_controller_told_for_it() -> None:
    state = State(
        axis=0,
        t_us=0,
        tick=7,
        mode=BoardState.ARMED,
        limiter=Limiter.SLEW,
        faults=1,
        warnings=2,
        i_meas_mA=(1001, 1002),
        i_applied_mA=(1003, 1004),
        v_mV=(1005, 1006),
        pump_duty=(51, 102),
        rtd_cC=(3001, 3002, 3003, 3004),
        encoder_counts=4000,
        force_counts=1500,
        vbus_mV=12_345,
        valid=sum(bit.value for bit in ValidBit),
        sp_seq=3,
        sp_age_us=800,
    )
    output = Output((0.1, 0.2), (0.0, 0.0), (False, True), 0.012)
    row = row_of(
        sample_of(state, 5_000_000, Scales({})),
        state,
        setpoint_of(output, t_ref_us=0),
        host_time_s=1e9,
        reference_m=0.003,
        reference_degC=60.0,
        pump_starts=(8, 9),
    )
    displacement_mm = 4000 * Scales({}).m_per_count * 1e3
    assert msgspec.structs.asdict(row) == {
        "t_s": 5.0,
        "host_time_s": 1e9,
        "tick": 7,
        "i_cmd_x_A": 0.1,
        "i_cmd_y_A": 0.2,
        "i_applied_x_A": 1.003,
        "i_applied_y_A": 1.004,
        "i_meas_x_A": 1.001,
        "i_meas_y_A": 1.002,
        "v_x_V": 1.005,
        "v_y_V": 1.006,
        "duty_x": 0.2,
        "duty_y": 0.4,
        "pump_starts_x": 8,
        "pump_starts_y": 9,
        "drain_x": 0,
        "drain_y": 1,
        "rtd_x_degC": 30.01,
        "rtd_y_degC": 30.02,
        "rtd_inlet_degC": 30.03,
        "rtd_ambient_degC": 30.04,
        "displacement_mm": pytest.approx(displacement_mm),
        "angle_deg": pytest.approx(displacement_mm * DEGREES_PER_MM),
        "force_N": pytest.approx(1500 * Scales({}).N_per_count),
        "supply_V": 12.345,
        "stage_mm": 12.0,
        "reference_mm": 3.0,
        "reference_degC": 60.0,
        "mode": BoardState.ARMED,
        "limiter": Limiter.SLEW,
        "faults": 1,
        "warnings": 2,
        "valid": state.valid,
        "setpoint_age_ms": 0.8,
    }
