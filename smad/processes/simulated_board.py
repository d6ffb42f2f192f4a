"""What a daemon needs to run on a simulated board: the bench beside it, and its configuration."""

import contextlib
from collections.abc import Iterable, Iterator
from importlib import resources
from pathlib import Path

import msgspec

from smad.client.endpoints import default_folder, prepare_folder
from smad.config import Config, replaced
from smad.errors import ConfigError
from smad.processes.boards import BOARDS
from smad.processes.simulator import simulated_bench
from smad.progress import Say


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
