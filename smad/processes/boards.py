"""The simulated benches that a configuration describes, a board for each axis."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from smad.errors import SmadError

if TYPE_CHECKING:
    from sim_device.bench import SimulatedBench
    from smad.config import Config


SEED_STEP = 100_003
"""Between the seeds of two axes: their noise must not be the same."""


@dataclass(frozen=True, kw_only=True)
class BoardType:
    """A board that `--firmware` names. `about`: what it is, for --help.

    `baud`: what it says it has; a pseudo-terminal takes any.
    """

    about: str
    baud: int
    most_rate_hz: int = 500
    has_store: bool = False
    """Whether it has a parameter memory in a file."""
    bench: Callable[[], Callable[..., SimulatedBench]]
    """Returns what makes a bench with it; imports that only when it is asked."""


class SimulatedBenchError(SmadError):
    """The simulated bench cannot be run as asked."""


def faults_of(faults: tuple[str, ...], axis: str) -> tuple[str, ...]:
    """Return the faults of one axis: those with its name and a colon before theirs."""
    if not axis:
        return faults
    return tuple(text.removeprefix(f"{axis}:") for text in faults if text.startswith(f"{axis}:"))


def rate_of(rate_hz: int, firmware: str) -> int:
    """Return the rate. Raises SimulatedBenchError where the board has not the time for it."""
    most_rate_hz = BOARDS[firmware].most_rate_hz
    if rate_hz > most_rate_hz:
        raise SimulatedBenchError(
            "the board is too slow for so many samples a second",
            value=rate_hz,
            limit=most_rate_hz,
            action=f"take --rate {most_rate_hz}, or --firmware host",
        )
    return rate_hz


def build(
    config: Config,
    *,
    rate_hz: int,
    seed: int,
    faults: tuple[str, ...] = (),
    model_path: Path | None = None,
    effects: tuple[str, ...] = (),
    firmware: str = "python",
    store_path: Path | None = None,
    axis: str = "",
) -> SimulatedBench:
    """Return the bench that the configuration describes, with the plant of a model file if given.

    `effects` are added to those of configuration or model, in place of one of the same name.
    `firmware` is a name of `BOARDS`; `store_path` the parameter memory of the C firmware.
    `axis` is the name that its board stores, if any.

    Raises BenchError and PlantError.
    """
    from sim_device.faults import parse_injection
    from sim_device.plant.effects.registry import from_texts
    from sim_device.plant.models import built_in, read_model

    plant = config.plant
    if model_path is None:
        model = replace(built_in(plant.parameter_file or "A"), variant=plant.variant)
        model = model.with_effects(plant.effects)
    else:
        model = read_model(model_path)
    model = model.with_effects(from_texts(effects))
    board = BOARDS[firmware]
    if store_path is not None and not board.has_store:
        raise SimulatedBenchError(
            "the model in Python keeps no parameter memory",
            value=str(store_path),
            action="add --firmware host, or leave --store out",
        )
    store = {"store_path": store_path} if board.has_store else {}
    return board.bench()(
        **model.physics,
        fixture=plant.fixture,
        rate_hz=rate_hz,
        seed=seed,
        faults=[parse_injection(text) for text in faults],
        axis_name=axis,
        **store,
    )


def effect_lines(effects: Mapping[str, Mapping[str, float]], named: Iterable[str]) -> Iterator[str]:
    """Yield a line for each effect of `named` (NAME or NAME:P=V): its values with their units."""
    from sim_device.plant.effects.registry import effect

    for text in named:
        name = text.partition(":")[0].strip()
        entry, values = effect(name), effects[name]
        pairs = ", ".join(
            f"{p.name} = {values[p.name]:g} {'' if p.unit == '1' else p.unit}".rstrip()
            for p in entry.parameters
        )
        yield f"effect {name}: {pairs}"


@contextmanager
def built(
    config: Config,
    *,
    seed: int,
    faults: tuple[str, ...],
    model_path: Path | None,
    effects: tuple[str, ...],
    firmware: str,
    store_path: Path | None,
) -> Iterator[dict[str, SimulatedBench]]:
    """Build a bench for each axis of the configuration, closed when the block ends; see `build`.

    `faults` of one axis of several begin with its name and a colon. Raises SimulatedBenchError too.
    """
    from sim_device.pty import symlink_of

    # Compiling the physics takes seconds the first time; a port that is silent for so long would
    # look like a dead board.
    build(config, rate_hz=100, seed=0).step()
    with ExitStack() as stack:
        benches = {}
        for k, (axis, axis_config) in enumerate(config.by_axis().items()):
            benches[axis] = build(
                axis_config,
                rate_hz=rate_of(axis_config.link.rate_hz, firmware),
                seed=(seed + k * SEED_STEP) % 2**32,
                faults=faults_of(faults, axis),
                model_path=model_path,
                effects=effects,
                firmware=firmware,
                store_path=symlink_of(store_path, axis),
                axis=axis,
            )
            stack.callback(benches[axis].close)
        yield benches


def _python(board_type: str) -> Callable[..., SimulatedBench]:
    """Return what makes a bench with a subclass of Board, named as `module:Class`."""
    from sim_device.bench import SimulatedBench

    module, _, name = board_type.partition(":")
    return partial(SimulatedBench, board_type=getattr(import_module(module), name))


def _firmware(port: str) -> Callable[..., SimulatedBench]:
    from sim_device.firmware.bench import firmware_bench

    return partial(firmware_bench, port)


BOARDS = {
    "python": BoardType(
        about="a model in Python", baud=921_600, bench=partial(_python, "sim_device.board:Board")
    ),
    "host": BoardType(
        about="the C firmware as a process",
        baud=921_600,
        has_store=True,
        bench=partial(_firmware, "host"),
    ),
    "avr": BoardType(
        about="its chip emulated",
        baud=500_000,
        most_rate_hz=100,
        has_store=True,
        bench=partial(_firmware, "avr"),
    ),
}
"""The boards by the name that `--firmware` takes."""
