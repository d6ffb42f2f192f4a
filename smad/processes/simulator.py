"""The simulated bench as a child process, for `smad start --sim` and the demo."""

import contextlib
import os
import select
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from importlib import resources
from pathlib import Path

import msgspec

from smad.client.endpoints import default_folder, prepare_folder
from smad.config import Config, replaced
from smad.errors import ConfigError, DaemonError, PortError
from smad.processes.boards import BOARDS
from smad.processes.starting import STALLED_S, StallDetector
from smad.progress import Say

PATIENCE = 60
"""What board and daemon allow each other is so many times longer: a busy computer is no fault."""
PACED = ("--paced-by-host", "--patience", str(PATIENCE))
"""Options of a board, and from the second on of its daemon, that wait for each other."""
READY = "ready: "
"""What the first line of `smad sim` begins with; the port's name follows."""

_END_DEADLINE_S = 10.0
_SEE = "run smad sim by itself to see why"


@contextlib.contextmanager
def simulated_bench(arguments: Sequence[str], symlink: Path, *, waiting: Say) -> Iterator[str]:
    """Run `smad sim` beside us for as long as the block lasts; yields the name of its port.

    `waiting` is told now and then that it is still starting. Raises DaemonError when it ends, or
    does nothing for STALLED_S.
    """
    child = subprocess.Popen(
        [
            *(sys.executable, "-m", "smad", "sim"),
            *("--symlink", str(symlink), "--parent", str(os.getpid())),
            *arguments,
        ],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # ctrl-C goes to the whole group of the terminal; the daemon has to disarm first.
        start_new_session=True,
    )
    try:
        _wait_until_ready(child, waiting)
        try:
            yield str(symlink)
        except PortError as error:
            raise _ended(child) or error from error
    finally:
        child.terminate()
        try:
            child.communicate(timeout=_END_DEADLINE_S)
        except subprocess.TimeoutExpired:
            child.kill()
            child.communicate()


def _wait_until_ready(child: subprocess.Popen[str], waiting: Say) -> None:
    assert child.stdout is not None
    stall = StallDetector(child.pid)
    while not stall.stalled():
        waiting("starting the simulated bench (the first time compiles its physics)")
        readable, _, _ = select.select([child.stdout], [], [], 0.5)
        if not readable:
            continue
        if child.stdout.readline().startswith(READY):
            return
        break
    child.kill()
    silence = (
        f"it did nothing for {STALLED_S:g} s" if stall.stalled() else "it ended without a word"
    )
    why = _complaint(child) or silence
    raise DaemonError(f"the simulated bench did not start: {why}", action=_SEE)


def _ended(child: subprocess.Popen[str]) -> DaemonError | None:
    """Return why the bench ended by itself, which takes its port away; None where it did not."""
    try:
        child.wait(_END_DEADLINE_S)
    except subprocess.TimeoutExpired:
        return None
    why = _complaint(child) or f"status {child.returncode}"
    return DaemonError(f"the simulated bench ended: {why}", action=_SEE)


def _complaint(child: subprocess.Popen[str]) -> str:
    _, complaint = child.communicate()
    return "".join(complaint.strip().splitlines()[-1:]).removeprefix("smad: ")


@contextlib.contextmanager
def simulated_board(
    config: Config,
    config_path: Path | None,
    *,
    faults: Iterable[str],
    firmware: str,
    patience: int | None,
    waiting: Say,
) -> Iterator[tuple[Config, str]]:
    """Run `smad sim` for as long as the block lasts, paced by the host where it has `patience`.

    `config` is that of the file, with what was asked for besides. Yields the configuration of the
    daemon on it, and the text of the plant's parameters. Raises ConfigError, and what
    `simulated_bench` does.
    """
    # Before the bench is started: it would wait for ever for a file that is a pipe.
    if config_path is not None and not config_path.is_file():
        raise ConfigError(
            "a simulated bench reads the configuration again, so it has to be a file",
            value=str(config_path),
            action="write it into a file",
        )
    parameter_text = _parameter_text(config)
    folder = Path(config.daemon.ipc_dir or default_folder()).absolute()
    prepare_folder(folder)
    plant = config.plant
    words = [
        *("--seed", str(plant.seed), "--rate", str(config.link.rate_hz)),
        *("--speed", str(plant.speed_ratio), "--firmware", firmware),
        *(("--axes", str(len(config.axes))) if config.axes else ()),
        *(word for text in faults for word in ("--fault", text)),
        *(() if config_path is None else ("--config", str(config_path))),
        *(() if patience is None else ("--paced-by-host", "--patience", str(patience))),
    ]
    if plant.speed_ratio != 1.0 or patience is not None:
        # Time that is not the wall's needs no priority; a loop that never sleeps would take a core.
        config = replaced(config, "realtime", fifo_priority=0)
    symlink = folder / f"{config.daemon.bench}.tty"
    with simulated_bench(words, symlink, waiting=waiting) as port:
        config = replaced(config, "link", port=port, baud=BOARDS[firmware].baud)
        placed = [msgspec.structs.replace(a, port=f"{port}.{a.name}") for a in config.axes]
        yield msgspec.structs.replace(config, axes=tuple(placed)), parameter_text


def _parameter_text(config: Config) -> str:
    if config.plant.parameter_file:
        path = Path(config.plant.parameter_file)
        if path.exists() and not path.is_file():
            raise ConfigError(
                "plant.parameter_file is not a file", value=str(path), action="name a TOML file"
            )
        return path.read_text()
    return (resources.files("sim_device") / "plant" / "data" / "set_a.toml").read_text()
