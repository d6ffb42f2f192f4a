"""The configuration: complete by default, checked on load, refused in one line."""

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import smad
from firmware_protocol.supervisor.host import host_limits
from firmware_protocol.supervisor.limits import LIMIT_ROWS, Limits, compiled_limits
from smad.config import Config, config_to_toml, default_toml, load_config, parse_config
from smad.config.axes import OF_THE_BENCH
from smad.config.describe import Key, sections
from smad.config.hostlimits import KEYS as HOST_KEYS
from smad.config.hostlimits import looser_than
from smad.errors import ConfigError

SMAD = Path(smad.__file__).parent
KEYS = [key for section in sections() for key in section.keys]
NUMBERS = [
    key
    for key in KEYS
    if isinstance(key.default, int | float) and not isinstance(key.default, bool)
]
FLOATS = [key for key in NUMBERS if isinstance(key.default, float)]
UNITS = {"A", "mm", "s", "ms", "ns", "K", "degC", "N", "hz", "MB", "min", "A_per_mm", "A_per_mm_s",
         "A_per_K", "A_per_K_s", "A_per_s", "mm_per_s", "K_per_s", "MPa", "J_per_m_K", "W_per_m_K",
         "W_per_m_A2", "MPa_per_K", "MPa_per_N", "deg", "deg_per_mm"}  # fmt: skip
WITHOUT_UNIT = {
    "baud", "axis", "switch_duty", "command_port", "stop_port", "command_queue", "queue_rows",
    "every_nth_sample", "high_water_mark", "fifo_priority", "seed", "speed_ratio", "drain_ratio",
    "near_bands", "pitch_sign", "yaw_sign",
}  # fmt: skip


NEEDED = {"axes": 'name = "a"\n', "segments": 'name = "a"\npitch = "b"\nyaw = "c"\n'}
"""What a table of which there may be many cannot do without."""
HEADINGS = {one.name: f"{one.heading}\n{NEEDED.get(one.name, '')}" for one in sections()}


def key_id(key: Key) -> str:
    return f"{key.section}.{key.name}"


def check_one_line(error: ConfigError) -> None:
    assert len(str(error).splitlines()) == 1


def refusal(text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_config(text, "bench.toml")
    check_one_line(caught.value)
    message = str(caught.value)
    assert message.startswith("bench.toml")
    return message


def test_an_empty_file_is_a_complete_configuration() -> None:
    assert parse_config("") == Config()


def test_the_default_file_holds_every_key_and_gives_the_defaults() -> None:
    text = default_toml()
    assert parse_config(text) == Config()
    for key in KEYS:
        assert re.search(rf"^(# )?{key.name} =", text, re.MULTILINE), key.name


def test_the_shipped_gains_are_those_that_tuning_the_shipped_plant_gives() -> None:
    control = Config().control
    assert (control.kp_A_per_mm, control.ki_A_per_mm_s) == (28.0, 23.0)
    assert control.current_limit_A == 4.0


@pytest.mark.parametrize("key", FLOATS, ids=key_id)
@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_no_number_of_a_file_can_be_nan_or_infinite(key: Key, value: str) -> None:
    message = refusal(f"{HEADINGS[key.section]}{key.name} = {value}")
    assert f"{key.section}.{key.name}" in message.replace("[0]", "")
    assert key.allowed in message
    assert f"got {value}" in message


@pytest.mark.parametrize("key", NUMBERS, ids=key_id)
def test_a_number_beyond_its_range_is_refused_with_path_value_and_limit(key: Key) -> None:
    message = refusal(f"{HEADINGS[key.section]}{key.name} = 1e15".replace("e15", "0" * 15))
    assert f"{key.section}.{key.name}" in message.replace("[0]", "")
    assert "got 1000000000000000" in message
    assert key.allowed in message


@pytest.mark.parametrize("key", NUMBERS, ids=key_id)
def test_every_number_has_its_unit_in_its_name(key: Key) -> None:
    has_unit = any(key.name.endswith(f"_{unit}") for unit in UNITS)
    assert has_unit != (key.name in WITHOUT_UNIT), (
        f"end the name of {key_id(key)} with its unit, a new one in UNITS, or put it in "
        "WITHOUT_UNIT"
    )


def test_every_key_is_read_by_a_room_beside_the_configuration() -> None:
    """A key that `smad.config` itself puts elsewhere, or that is looked up by name, is left out."""
    modules = [f for f in SMAD.rglob("*.py") if f.relative_to(SMAD).parts[0] != "config"]
    read = set(re.findall(r"\.(\w+)", "\n".join(file.read_text() for file in modules)))
    keys = [k for k in KEYS if not k.name.startswith("on_") and k.name not in OF_THE_BENCH]
    unread = [key_id(key) for key in keys if key.name not in read]
    assert not unread, f"nothing outside smad/config reads {unread}"


@pytest.mark.parametrize("key", KEYS, ids=key_id)
def test_every_key_says_what_it_is_for(key: Key) -> None:
    assert key.description
    assert key.allowed


TEXTS = [key for key in KEYS if isinstance(key.default, str)]


@pytest.mark.parametrize("key", TEXTS, ids=key_id)
def test_a_text_with_a_nul_is_refused_in_one_line(key: Key) -> None:
    message = refusal(f'{HEADINGS[key.section]}{key.name} = "a\\u0000b"')
    assert key.name in message
    assert "\n" not in message
    assert "\0" not in message


HOST = host_limits(compiled_limits())


@pytest.mark.parametrize("row", HOST_KEYS)
def test_a_limit_may_be_as_loose_as_the_hosts_share_of_the_boards_and_no_looser(row: str) -> None:
    key, scale = HOST_KEYS[row]
    section, _, name = key.rpartition(".")
    limit = getattr(HOST, row) / scale
    config = parse_config(f"[{section}]\n{name} = {limit:.10g}")
    assert not list(looser_than(config, compiled_limits()))
    looser = int(limit) + 1
    message = refusal(f"[{section}]\n{name} = {looser}")
    assert f"got {looser}" in message
    assert f"to {limit:g}" in message


def test_every_limit_of_the_host_that_can_be_configured_is_held_against_the_board() -> None:
    tightest = Limits(**{name: row.tightest for name, row in LIMIT_ROWS.items()})
    found = {one.key: one for one in looser_than(Config(), tightest)}
    assert set(found) == {key for key, _ in HOST_KEYS.values()}
    assert found["limits.on_time_max_s"] == (
        "limits.on_time_max_s",
        3600.0,
        57.0,
        "on_time_limit_s",
    )


def test_an_unknown_key_is_refused_and_the_nearest_one_named() -> None:
    message = refusal("[control]\nkp_A_per_mmm = 3.0")
    assert "unknown key control.kp_A_per_mmm" in message
    assert "did you mean kp_A_per_mm?" in message


def test_an_unknown_section_is_refused() -> None:
    assert "did you mean limits?" in refusal("[limit]\n")


def test_a_number_in_quotes_is_shown_with_them() -> None:
    said = refusal('[control]\nkp_A_per_mm = "3"\n')
    assert 'control.kp_A_per_mm is not allowed; got "3"; allowed: 0 to 1000' in said


def test_a_rate_that_the_board_does_not_know_is_refused() -> None:
    assert "link.rate_hz is not allowed; got 99; allowed: 100 or 250 or 500" in refusal(
        "[link]\nrate_hz = 99"
    )


def test_a_cooling_switch_without_hysteresis_is_refused() -> None:
    message = refusal("[control.cooling]\non_threshold_A = 0.1\noff_threshold_A = 0.2")
    assert "0.2" in message
    assert "0.1" in message
    assert "control.cooling" in message


def test_tcp_without_an_allow_list_is_refused() -> None:
    assert "allowed_keys" in refusal("[daemon.tcp]\nenabled = true")


def test_a_section_that_is_a_value_is_refused() -> None:
    assert "link is not a table" in refusal("link = 3")


def test_text_that_is_not_toml_is_refused_with_its_line() -> None:
    assert "line 2" in refusal("[link]\nport = = 3\n")


def test_nesting_without_end_is_refused() -> None:
    assert refusal("x = " + "[" * 100_000)


def test_a_configuration_survives_being_written_and_read() -> None:
    config = parse_config(
        '[link]\nport = "a\\"b\\\\c\\u0007é"\n[control]\nkp_A_per_mm = 0.1\n'
        "[plant.effects.drag]\nstrength = 0.25\n[daemon.tcp]\n"
        f'enabled = true\nallowed_keys = ["{"k" * 40}"]\n'
    )
    assert parse_config(config_to_toml(config)) == config
    assert config.plant.effects == {"drag": {"strength": 0.25}}


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"cannot read configuration .*nothing\.toml"):
        load_config(tmp_path / "nothing.toml")


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot read configuration"):
        load_config(tmp_path)


def test_bytes_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not UTF-8"):
        load_config(path)


def test_a_file_far_too_large_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_bytes(b"#" * 1_000_001)
    with pytest.raises(ConfigError, match="too large"):
        load_config(path)


def test_a_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text("[limits]\ntemperature_max_degC = 60.0\n")
    assert load_config(path).limits.temperature_max_degC == 60.0


VALUES = st.one_of(
    st.integers(),
    st.floats(allow_nan=True),
    st.booleans(),
    st.text(st.characters(codec="utf-8", exclude_characters="'\n\r\x00"), max_size=5),
)


def as_toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else repr(value)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.sampled_from(KEYS), VALUES), max_size=4))
def test_any_value_for_any_key_is_taken_or_refused_in_one_line(
    entries: list[tuple[Key, object]],
) -> None:
    text = "\n".join(f"{key.section}.{key.name} = {as_toml(value)}" for key, value in entries)
    try:
        config = parse_config(text)
    except ConfigError as error:
        check_one_line(error)
    else:
        assert parse_config(config_to_toml(config)) == config


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.text())
def test_any_text_is_a_configuration_or_refused_in_one_line(text: str) -> None:
    try:
        parse_config(text)
    except ConfigError as error:
        check_one_line(error)


AXES = '[[axes]]\nname = "pitch-1"\nport = "/dev/a"\n[[axes]]\nname = "yaw-1"\nport = "/dev/b"\n'


def test_an_axis_has_the_values_of_the_bench_but_for_its_own() -> None:
    text = f"{AXES}kp_A_per_mm = 20.0\ntravel_mm = 4.0\n[control]\nki_A_per_mm_s = 5.0\n"
    config = parse_config(text)
    first, second = config.by_axis().values()
    assert (first.link.port, second.link.port) == ("/dev/a", "/dev/b")
    assert (first.control.kp_A_per_mm, second.control.kp_A_per_mm) == (28.0, 20.0)
    assert second.control.ki_A_per_mm_s == first.control.ki_A_per_mm_s == 5.0
    assert second.limits.displacement_max_mm == 4.0
    assert parse_config(config_to_toml(config)) == config


def test_a_bench_of_one_axis_has_no_word_of_axes_in_its_configuration() -> None:
    assert "axes" not in config_to_toml(Config()).replace("[plant]", "")
    assert Config().by_axis() == {"": Config()}
    assert Config().with_axes(1) == Config()
    assert list(Config().with_axes(6).by_axis())[-1] == "yaw-3"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (AXES.replace("yaw-1", "pitch-1"), "two have the name 'pitch-1'"),
        (AXES.replace("/dev/b", "/dev/a"), "two have the port '/dev/a'"),
        (f"{AXES}travel_mm = 99.0\n", r"axes\[1\]\.travel_mm is not allowed; got 99\.0"),
        (f"{AXES}travel = 9.0\n", r"unknown key axes\[1\]\.travel; did you mean travel_mm"),
        ('[[axes]]\nname = "two words"\n', r"axes\[0\]\.name is not allowed; got two words"),
    ],
)
def test_axes_that_clash_or_are_wrong_are_named(text: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        parse_config(text)
