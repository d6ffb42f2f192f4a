"""What the page is made of: forms from the types, strips from the table, conditions in words."""

import json
from pathlib import Path
from typing import Any, get_args

import msgspec
import pytest

from smad import api
from smad.config import AxisConfig, Config, ControlConfig
from smad.control.commands import Samples, Trajectory, Tune
from smad.control.controller import Controller
from smad.control.inforce import tune_of
from smad.runlog.schema import CHANNELS, ChannelSpec
from smad.style import strips
from smad.view import commands, forms, page, state
from smad.view.source import Source

STATIC = Path(page.__file__).parent / "static"


def read(form: forms.Form) -> dict[str, Any]:
    return {field.name: field.initial for field in form.fields}


def test_every_trajectory_has_a_form_whose_first_values_are_a_valid_command() -> None:
    made = {form.tag: form for form in forms.trajectories()}
    assert len(made) == len(get_args(Trajectory)) - 1
    for tag, form in made.items():
        piece = msgspec.convert({"kind": tag, **read(form)}, type=Trajectory)
        assert not isinstance(piece, Samples)
        assert form.about


def test_the_bounds_of_a_form_are_those_of_the_type() -> None:
    sine = next(form for form in forms.trajectories() if form.tag == "sine")
    period = next(field for field in sine.fields if field.name == "period_s")
    assert (period.label, period.unit, period.least, period.above) == ("period", "s", 0.0, True)
    cycles = next(field for field in sine.fields if field.name == "cycles")
    assert (cycles.kind, cycles.least, cycles.most) == ("whole", 1, 10_000)


def test_the_gains_begin_at_those_in_force_and_each_alone_is_a_valid_command() -> None:
    config = Config(control=ControlConfig(kp_A_per_mm=7.5, current_limit_A=2.5))
    form = forms.tuning(config)
    assert {field.name for field in form.fields} == set(Tune.__struct_fields__)
    assert read(form)["kp_A_per_mm"] == 7.5
    assert None not in read(form).values()
    assert all(field.unit for field in form.fields if field.kind == "number")
    for field in form.fields:
        msgspec.convert({"mode": "tune", field.name: field.initial}, type=Tune)
    limit = next(field for field in form.fields if field.name == "current_limit_A")
    assert limit.slider == limit.most == 2.5


def test_a_gain_of_zero_still_has_a_slider() -> None:
    form = forms.tuning(Config(control=ControlConfig(ki_A_per_mm_s=0.0)))
    assert all(field.slider != 0.0 for field in form.fields)


def test_every_channel_of_the_page_is_one_of_the_telemetry() -> None:
    assert set(strips.PLACES) <= set(api.Telemetry.__struct_fields__)
    sample = api.Telemetry(timestamp=1.0, sequence=1, t_s=1.0, force_N=2.5)
    assert dict(zip(strips.PLACES, strips.values(sample), strict=True))["force_N"] == 2.5


def test_every_quantity_of_the_log_is_a_channel_and_the_first_strips_have_theirs() -> None:
    assert set(strips.PLACES) == set(CHANNELS) - strips.NO_QUANTITY
    shown = {name for names in (*strips.LAYOUT, *strips.XY_LAYOUT) for name in names}
    assert shown <= set(strips.PLACES)
    assert all(channel.title and channel.label for channel in strips.CHANNELS)


def test_a_channel_of_any_unit_is_drawn_with_decimals_and_as_its_springs() -> None:
    heat = ChannelSpec("heat_y_W", "W", "float", "heat into the wire, Y", "STATE")
    drawn = strips.in_no_strip(heat)
    assert (drawn.title, drawn.label, drawn.pen, drawn.digits) == (
        "Heat into the wire",
        "Y",
        "y",
        2,
    )


@pytest.mark.parametrize("name", [name for name in strips.PLACES if "_x" in name])
def test_the_channels_of_both_springs_have_one_title(name: str) -> None:
    x, y = (strips.CHANNELS[strips.PLACES[n]] for n in (name, name.replace("_x", "_y")))
    assert x.title == y.title, "end their descriptions with `, X` and `, Y`"
    assert (x.label, y.label) == ("X", "Y")


def test_limits_are_those_of_the_configuration() -> None:
    limits = strips.limits(Config())
    assert limits["rtd_x_degC"] == Config().limits.temperature_max_degC
    assert limits["displacement_mm"] == Config().limits.displacement_max_mm


def test_every_command_of_a_page_has_a_way_to_the_client() -> None:
    assert all(hasattr(kind, "carry_out") for kind in get_args(commands.Command))


def test_the_first_message_holds_nothing_that_json_cannot() -> None:
    source = Source("bench")
    text = msgspec.json.encode(
        [
            page.hello(source, source.axis(""), "command"),
            page.status_message(source, source.axis(""), ours=False),
        ]
    )
    assert json.loads(text)[0]["layout"]["strips"][0][0] == "displacement_mm"


def test_of_several_axes_a_page_has_a_tile_and_a_condition_for_each() -> None:
    source = Source("bench")
    names = ("pitch-1", "yaw-1", "pitch-2")
    source.on_config(Config(axes=tuple(AxisConfig(name=name, travel_mm=4.0) for name in names)))
    ready, warm, armed = status(), status(obstacle="a spring is not cold"), status("ARMED")
    parts = dict(zip(names, (ready, warm, armed), strict=True))
    source.on_status(msgspec.structs.replace(ready, axes=parts))
    told = page.status_message(source, source.axis("yaw-1"), ours=False)
    assert [tile.axis for tile in told["tiles"]] == list(names)
    conditions = {one.axis: one for one in told["status"].conditions}
    assert set(conditions) == {"", "pitch-1", "yaw-1"}, "the third is armed already"
    assert conditions["pitch-1"].holds
    assert conditions["yaw-1"].holds is False
    assert conditions["yaw-1"].detail == "a spring is not cold"
    assert told["armed"]
    assert told["limits"]["displacement_mm"] == 4.0


def status(
    mode: str = "SAFE", fault: api.Fault | None = None, obstacle: str = "", **row: Any
) -> api.Status:
    raw: dict[str, Any] = {
        field.name: None for field in msgspec.structs.fields(api.Status) if field.required
    }
    spread = {"own_share": {}, "setpoint_age": {}, "jitter": {}}
    link = {
        "port": "p", "baud": 1, "rate_hz": 100, "state": "monitor", "notes": [], "bytes_in": 0,
        "bytes_out": 0, "short_writes": 0, "losses": 0, "frames": {}, "board_stats": {},
    }  # fmt: skip
    motion = {
        "running": "idle",
        "done": True,
        "armed": mode == "ARMED",
        "mode": mode,
        "reference_mm": None,
        "displacement_mm": None,
        "board_time_s": 1.0,
        "fault": None if fault is None else msgspec.to_builtins(fault),
        "generation": 3,
    }
    raw |= {
        "bench": "b", "version": "1", "pid": 1, "uptime_s": 1.0, "memory_MiB": 1.0, "link": link,
        "motion": motion, "sample": {"t_s": 1.0, **row}, "limiter": "none", "faults": [],
        "warnings": [], "counts": dict.fromkeys(api.Counts.__struct_fields__, 0),
        "timing": {**spread, "round_trip_us": 100.0, "collections": 0}, "realtime": [],
        "recorder": {"recording": False}, "control": {}, "events": [],
        "gains": {"mode": "tune", "kp_A_per_mm": 7.0}, "obstacle": obstacle,
    }  # fmt: skip
    return msgspec.convert(raw, type=api.Status)


def test_the_gains_that_a_page_shows_are_those_in_force() -> None:
    assert state.bench_state(status()).gains == {"kp_A_per_mm": 7.0}


def test_a_controller_says_what_is_in_force_and_not_only_what_was_configured() -> None:
    config = ControlConfig(kp_A_per_mm=3.0)
    controller = Controller(config)
    controller.command(Tune(kp_A_per_mm=7.0))
    controller.command(Tune(feedforward=False))
    expected = msgspec.structs.replace(tune_of(config), kp_A_per_mm=7.0, feedforward=False)
    assert controller.gains == expected


def test_control_stands_against_arming_only_while_another_has_it() -> None:
    assert state.control_condition("", ours=False).holds
    assert state.control_condition("live page", ours=True).holds
    theirs = state.control_condition("Ada", ours=False)
    assert (theirs.holds, theirs.detail) == (False, "Ada has it")


def test_the_first_fault_is_said_in_plain_words() -> None:
    fault = api.Fault(
        number=6, name="OVER_TEMPERATURE", channel="SPRING_X", measured=96.0, limit=95.0, unit="°C"
    )
    shown = state.bench_state(status(mode="FAULT", fault=fault))
    assert shown.trouble is not None
    assert "96 °C" in shown.trouble.what
    assert shown.trouble.cause
    assert shown.trouble.remedy


def test_the_page_puts_nothing_in_as_markup() -> None:
    for path in STATIC.glob("*.js"):
        text = path.read_text()
        assert "innerHTML" not in text
        assert "insertAdjacentHTML" not in text
        assert "eval(" not in text


def test_the_page_asks_no_other_machine_for_anything() -> None:
    for path in (*STATIC.glob("*.js"), *STATIC.glob("*.css"), STATIC / "index.html"):
        assert "http" not in path.read_text(), path.name
    files = page.static_files()
    assert all(name.startswith("/") for name in files)
    assert "Permission is hereby granted" in files["/style/vendor/LICENSE.txt"][1].decode()
