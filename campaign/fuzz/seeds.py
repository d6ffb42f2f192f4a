"""The inputs that fuzzing begins from, made from real things: `python -m campaign.fuzz.seeds`.

They are committed; this module says where they came from, and a test that they can be made again.
"""

from __future__ import annotations

import json
import random
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from importlib import resources
from pathlib import Path

import msgspec
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from campaign.fuzz.board import FIXTURES
from campaign.fuzz.corpus import write_corpus
from campaign.fuzz.log_import import SEPARATOR
from campaign.fuzz.targets import TARGETS
from campaign.soak.draws import DRAWN
from firmware_protocol import messages as m
from firmware_protocol.codec import CODEC
from firmware_protocol.enums import BoardState, SetpointFlag
from firmware_protocol.schema import canonical_json, compress, describe, own_crc
from sim_device.bench import SimulatedBench
from smad.api import METHODS
from smad.config import default_toml
from smad.runlog.export import export_run
from smad.runlog.header import METADATA_NAME, RunHeader
from smad.runlog.reader import read_run
from smad.runlog.schema import EVENT_TOPIC, LINK_TOPIC, ROW_TOPIC
from tests.firmware_protocol.pair import SAMPLE
from tests.smad.runlog.helpers import write_small_run

Seeds = Iterator[tuple[str, bytes]]
_LONGEST_REQUEST_BYTES = 1000


def main() -> int:
    """Write the seeds of every target that are not there yet."""
    for name, make in SEEDS.items():
        seeds = {f"seed-{label}": data for label, data in make()}
        write_corpus(TARGETS[name].archive, TARGETS[name].corpus() | seeds)
    return 0


def _recorded() -> bytes:
    """What a simulated board says in its first samples to a host that shakes hands."""
    bench = SimulatedBench(seed=1)
    said = b"".join(bench.step() for _ in range(8))
    bench.receive(CODEC.frame(m.Hello(m.PROTOCOL_MAJOR, m.PROTOCOL_MINOR, own_crc(), 9), 0, 0))
    session = bench.board.session.session
    for seq, request in enumerate((m.ParamGet(0, 1), m.ArmRequest(0, 0), m.Disarm(0)), start=1):
        bench.receive(CODEC.frame(request, seq, session))
    return said + b"".join(bench.step() for _ in range(3))


def _frames() -> Seeds:
    stream = _recorded()
    yield "recorded", b"\x07\x00" + stream[:900]
    yield "one-frame", b"\x01\x11" + CODEC.frame(m.Disarm(0), 3, 4)
    yield "cut", b"\x03\x20" + stream[40:140]


_SAMPLES, _GREET, _ARM, _SETPOINT, _MEASURE, _CONFIRM, _DRIVE, _PAUSE = range(3, 11)
_TOKENS = (0, 1, 0x7FFF_FFFF, 0x8000_0000, 0xFFFF_FFFF)
_STAGES_um = (0, 1, 200_000, 200_001, 2**31 - 1, -1, -(2**31))


def _drives() -> Seeds:
    """What both the board alone and the whole bench begin with, on each fixture."""
    drive = bytes([_SETPOINT, 100, 50, 0, 100])
    for number, fixture in enumerate(FIXTURES):
        begin = bytes([number, _GREET, 9, _SAMPLES, 5])
        yield f"{fixture}-driven", begin + bytes([_ARM]) + drive * 4 + bytes([_SAMPLES, 30])
        tokens = b"".join(bytes([_CONFIRM, 1]) + token.to_bytes(4, "little") for token in _TOKENS)
        yield f"{fixture}-tokens", begin + tokens + bytes([_ARM]) + drive
        stages = b"".join(
            bytes([_DRIVE])
            + CODEC.pack(m.Setpoint(0, 0, (500, 0), (0, 0), SetpointFlag.STAGE, 100, stage_um))
            for stage_um in _STAGES_um
        )
        yield f"{fixture}-stages", begin + bytes([_ARM]) + stages + drive
        pauses = b"".join(bytes([_PAUSE, 0, high]) + drive for high in (85, 100, 140, 180, 255))
        yield f"{fixture}-pauses", begin + drive + pauses


def _board() -> Seeds:
    yield from _drives()
    hot = [0, _GREET, 9, _ARM, _SETPOINT, 250, 0, 0, 100, _MEASURE, 1, 1, 250, 70, 0, 9]
    yield "hot", bytes(hot)
    for number in sorted(CODEC.layouts):
        layout = CODEC.layouts[number]
        if number >= m.FIRST_BOARD_NUMBER:
            break
        position = [n for n in sorted(CODEC.layouts) if n < m.FIRST_BOARD_NUMBER].index(number)
        body = bytes(range(layout.size))
        begin = bytes([position % len(FIXTURES), _GREET, 1, 2, position])
        yield f"message-{number:02x}", begin + body + bytes([1, _SAMPLES, 2])


_HOST_MESSAGE, _HOST_WAIT, _HOST_SAMPLE, _HOST_ASK, _HOST_ARM, _HOST_PORT = 2, 3, 4, 5, 6, 7


_FIRST_FROM_BOARD = sum(number < m.FIRST_BOARD_NUMBER for number in CODEC.layouts)


def _host() -> Seeds:
    connect = [_HOST_SAMPLE, 7]
    yield "armed", bytes([*connect, _HOST_ARM, *connect, _HOST_ASK, 0, *connect])
    yield "lost", bytes([*connect, _HOST_ARM, _HOST_WAIT, 200, *connect, _HOST_PORT, 0])
    yield "reopened", bytes([*connect, _HOST_PORT, 0, _HOST_PORT, 1, *connect, _HOST_PORT, 3])
    yield "estop", bytes([*connect, _HOST_ARM, _HOST_PORT, 2, *connect])
    sample = msgspec.structs.replace(SAMPLE, t_us=1_090_000, mode=BoardState.ARMED)
    state = sorted(CODEC.layouts).index(m.State.info.number) - _FIRST_FROM_BOARD
    yield (
        "armed-by-another",
        bytes([*connect, _HOST_MESSAGE, state]) + CODEC.pack(sample) + bytes([1]),
    )
    to_host = [n for n in sorted(CODEC.layouts) if n >= m.FIRST_BOARD_NUMBER]
    for position, number in enumerate(to_host):
        body = bytes(range(CODEC.layouts[number].size))
        yield (
            f"message-{number:02x}",
            bytes([*connect, _HOST_MESSAGE, position]) + body + bytes([1, 4, 1]),
        )


def _description() -> Seeds:
    sample = bytes([m.State.info.number, len(CODEC.pack(SAMPLE))]) + CODEC.pack(SAMPLE)
    yield "own", canonical_json(describe()) + b"\f" + sample
    axis = {"name": "axis", "kind": "u8"}
    fields = [axis, {"name": "tick", "kind": "u16"}, {"name": "rtd_cC", "kind": "i32", "count": 2}]
    other = [{"name": "STATE", "number": m.State.info.number, "fields": fields}]
    small = {"version": [1, 9], "messages": other, "enums": {"Fault": {"NONE": 0}}}
    yield "other", canonical_json(small) + b"\f" + bytes([m.State.info.number, 11, *range(11)])
    record = [{"name": "snapshot", "kind": "record", "record": "STATE"}]
    report = {"name": "FAULT", "number": m.FaultReport.info.number, "fields": record}
    yield "record", canonical_json({"messages": [*other, report]}) + b"\f" + bytes(20)
    yield "raw", b"!" + compress(small)


def _commands() -> Seeds:
    rng = random.Random(1)
    for method in METHODS:
        # As a soak draws it, until it is short enough to be mutated.
        text = b" " * _LONGEST_REQUEST_BYTES
        while len(text) >= _LONGEST_REQUEST_BYTES:
            params = DRAWN[method.name].draw(rng)
            text = msgspec.json.encode(
                {"jsonrpc": "2.0", "id": 1, "method": method.name, "params": params}
            )
        yield method.name.replace(".", "-"), b"\x01" + text
    yield (
        "several",
        b'\x00{"method":"arm","id":"a"}\n{"method":"disarm","id":2}\n{"method":"estop"}',
    )
    pieces = [
        {"kind": "sine", "amplitude_mm": 3.0, "period_s": 2.0, "cycles": 2},
        {"kind": "chirp", "amplitude_mm": 1.0, "start_Hz": 0.1, "end_Hz": 1.0, "duration_s": 5.0},
        {"kind": "samples", "t_s": [0.0, 1.0], "displacement_mm": [0.0, 2.0]},
    ]
    move = {"method": "move", "id": 3, "params": {"trajectories": pieces}}
    yield "trajectories", b"\x01" + json.dumps(move).encode()


def _runlog() -> Seeds:
    with tempfile.TemporaryDirectory() as folder:
        path = write_small_run(Path(folder) / "run.mcap", 4)
        whole = path.read_bytes()
    yield "whole", whole
    yield "cut", whole[: len(whole) * 2 // 3]
    yield "damaged", MCAP0_MAGIC + bytes([Opcode.CHANNEL]) + (3).to_bytes(8, "little") + b"abc"
    for label, compression in (("plain", CompressionType.NONE), ("lz4", CompressionType.LZ4)):
        with tempfile.TemporaryFile() as file:
            writer = Writer(file, compression=compression, enable_crcs=False, use_statistics=False)
            writer.start()
            writer.add_metadata(METADATA_NAME, RunHeader(name="seed").to_metadata())
            for topic, body in (
                (ROW_TOPIC, b'{"t_s":0.01,"tick":1,"displacement_mm":null}'),
                (EVENT_TOPIC, b'{"t_s":1,"kind":"arm","text":"armed","data":{"a":1}}'),
                (LINK_TOPIC, b'{"t_s":1,"counters":{"crc_errors":3}}'),
            ):
                channel = writer.register_channel(
                    topic, "json", writer.register_schema("", "", b"")
                )
                writer.add_message(channel, 1, body, 1)
            writer.finish()  # type: ignore[no-untyped-call]
            file.seek(0)
            yield label, file.read()


def _config() -> Seeds:
    text = default_toml().encode()
    yield "default", text
    bare = b"\n".join(line for line in text.splitlines() if line and not line.startswith(b"#"))
    yield "bare", bare
    yield (
        "few",
        b'[link]\nport = "/dev/ttyUSB0"\nrate_hz = 250\n\n[daemon.tcp]\ncommand_port = 5600\n',
    )
    yield "effects", b'[plant]\nseed = 7\n\n[plant.effects."x y"]\n"a\\nb" = 1e-3\n'


def _parameters() -> Seeds:
    data = resources.files("sim_device.plant") / "data"
    yield "set-a", (data / "set_a.toml").read_bytes()
    yield "set-b", (data / "set_b.toml").read_bytes()
    for label, value in (("extends", 12), ("out-of-range", 15)):
        entry = f'value = {value}\nunit = "1"\nstatus = "assumed"\nrange = [10, 14]\n'
        text = f'extends = "set_a.toml"\n\n[coils]\n{entry}source = "counted"\n'
        yield label, text.encode()


def _models() -> Seeds:
    model = {
        "format": "smad-model-1",
        "base": "B",
        "variant": "printed",
        "overrides": {"coils": 12.0},
        "effects": {"tendon_stretch": {}},
        "note": "a note",
    }
    from sim_device.plant.effects.registry import EFFECTS

    model["effects"] = {EFFECTS[0].name: {}}
    yield "json", b"\x01" + json.dumps(model, indent=1).encode()
    effect = EFFECTS[1]
    parameter = effect.parameters[0]
    yield (
        "toml",
        (
            b'\x00format = "smad-model-1"\nbase = "A"\nnote = "n"\n\n[overrides]\ncoils = 12\n\n'
            + f"[effects.{effect.name}]\n{parameter.name} = {parameter.typical}\n".encode()
        ),
    )


def _import() -> Seeds:
    plain = b"time_s,displacement_mm,T_x_K,current_x (mA),mode\n0,1.5,300,20,2\n0.01,1.6,301,21,2\n"
    yield "plain", plain
    yield "backwards", b"time_s,displacement_mm\n1,1.5\n0,1.6\n"
    yield (
        "german",
        (
            b"# a comment\nZeit;Weg\n0,0;1,5\n0,01;1,6\n" + SEPARATOR + b'[csv]\ndecimal = ","\n'
            b'[columns."Zeit"]\nchannel = "t_s"\n[columns."Weg"]\nchannel = "displacement_mm"\n'
            b'unit = "m"\nscale = 2.0\noffset = 1.0\n'
        ),
    )
    with tempfile.TemporaryDirectory() as folder:
        run = read_run(write_small_run(Path(folder) / "run.mcap", 3))
        csv, beside = export_run(run, Path(folder) / "run.csv")
        yield "exported", csv.read_bytes() + SEPARATOR * 2 + beside.read_bytes()


SEEDS: Mapping[str, Callable[[], Seeds]] = {
    "frames": _frames,
    "host": _host,
    "description": _description,
    "board": _board,
    "bench": _drives,
    "commands": _commands,
    "runlog": _runlog,
    "config": _config,
    "parameters": _parameters,
    "models": _models,
    "import": _import,
}

if __name__ == "__main__":
    sys.exit(main())
