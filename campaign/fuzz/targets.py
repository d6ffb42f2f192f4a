"""The table of what is fuzzed. A target is a function of bytes that raises only on a defect."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from campaign.fuzz.corpus import read_corpus

CORPUS = Path(__file__).parent / "corpus"

Harness = Callable[[bytes], None]


@dataclass(frozen=True)
class Target:
    """One row: the harness's module in this package, what it tests, which packages are
    instrumented.

    `longest` is the largest input in bytes; `allowed_s` the CPU time that one input may take.
    """

    name: str
    module: str
    what: str
    instrumented: tuple[str, ...]
    longest: int
    allowed_s: float = 2.0

    def harness(self) -> Harness:
        """Import the harness and return its `run`."""
        run: Harness = importlib.import_module(f"campaign.fuzz.{self.module}").run
        return run

    @property
    def archive(self) -> Path:
        """Where its inputs are kept."""
        return CORPUS / f"{self.name}.zip"

    def corpus(self) -> dict[str, bytes]:
        """The inputs that are kept, by name."""
        return read_corpus(self.archive)


_PROTOCOL = ("firmware_protocol",)
_DAEMON = ("firmware_protocol", "smad")
_BOARD = ("firmware_protocol", "sim_device")
_LOGS = ("smad", "mcap")
_FILES = ("smad", "tomllib")
_PLANT = ("sim_device", "tomllib")

TARGETS: Mapping[str, Target] = {
    target.name: target
    for target in (
        Target("frames", "frames", "frame decoder and codec", _PROTOCOL, 1024),
        Target("host", "host", "host session with the control task", _DAEMON, 1024),
        Target("description", "description", "another board's messages", _PROTOCOL, 16_384),
        Target("board", "board", "board session with the supervisor", _BOARD, 1024),
        Target("bench", "bench", "the whole simulated bench", _BOARD, 512),
        # An input may cost the next one a new daemon.
        Target("commands", "commands", "command server and its daemon", _DAEMON, 2048, 8.0),
        Target("runlog", "runlog", "run-log reader and recovery", _LOGS, 16_384),
        Target("config", "config", "configuration loader", _FILES, 16_384),
        Target("parameters", "parameters", "parameter files", _PLANT, 16_384),
        Target("models", "models", "model files", _PLANT, 4096),
        Target("import", "log_import", "`smad log import`", _FILES, 4096),
    )
}
