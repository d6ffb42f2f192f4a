"""`smad run endurance`: one cycle many times, with statistics, check-ups and limits that end it."""

from __future__ import annotations

import contextlib
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import click

from smad.cli.options import FOLDER, Command, axis_option, flag, lease_option, option, together
from smad.cli.output import ready_client
from smad.cli.quantity import Quantity, Whole
from smad.cli.simulated import effect_option, seed_option, sim_option, simulated_model
from smad.counted import counted
from smad.view.terminal.progress import progress

_percent = Quantity("pct", 0.0, 100.0, above=True)


@dataclass(frozen=True, kw_only=True)
class _Ends:
    """The limits, by their names in `EndLimits`."""

    stroke_lost_percent: float | None = option(
        "--end-stroke-lost %", "End when this much stroke is lost.", _percent
    )
    resistance_up_percent: float | None = option(
        "--end-resistance-up %", "End when resistance has risen by this much.", _percent
    )
    shift_K: float | None = option(
        "--end-shift K",
        "End when the transformation shifted.",
        Quantity("K", 0.0, 100.0, above=True),
    )
    place_probability: float | None = option(
        "--end-place P",
        "With --every: end when a place has changed with this probability.",
        Quantity("1", 0.0, 1.0, above=True),
    )


@dataclass(frozen=True, kw_only=True)
class _Cycle:
    """What one cycle is."""

    displacement: tuple[float, float] | None = option(
        "--displacement LOW HIGH",
        "Without --temperature: cycle between these, mm  [default: -5 5]",
        Quantity("mm", -20.0, 20.0),
    )
    temperature: tuple[float, float] | None = option(
        "--temperature LOW HIGH",
        "Cycle one spring between these instead, °C.",
        Quantity("degC", 0.0, 95.0),
    )
    spring: Literal["x", "y"] = option(
        "--spring", "With --temperature: the spring.", click.Choice(["x", "y"]), default="x"
    )
    rate: float = option(
        "--rate MM/S",
        "Rate of the ramps; K/s with --temperature.",
        Quantity(low=0.01, high=50.0),
        default=2.0,
    )
    dwell: float = option("--dwell S", "Pause at each end.", Quantity("s", 0.0, 600.0), default=1.0)

    def profile(self) -> Any:
        from smad.experiments.endurance.profile import Profile

        low, high = self.temperature or self.displacement or (-5.0, 5.0)
        return Profile(
            quantity="temperature" if self.temperature else "displacement",
            low=low,
            high=high,
            rate=self.rate,
            dwell_s=self.dwell,
            spring=self.spring,
        )


@click.command(cls=Command)
def endurance(
    *,
    cycles: int = option("--cycles", "How many.", Whole(1, 10_000_000), required=True),
    cycle: _Cycle = together(_Cycle),
    every: tuple[int, str] | None = option(
        "--every N checkup",
        "With --baseline: play the quick check-up every N cycles.",
        (Whole(1), click.Choice(["checkup"])),
    ),
    baseline: Path | None = option(
        "--baseline", "With --every: baseline of the check-ups.", FOLDER
    ),
    ends: _Ends = together(_Ends),
    full_every: int = option(
        "--full-every",
        "Keep all samples of every n-th cycle, only statistics of the others.",
        Whole(1, 1_000_000),
        default=1,
    ),
    folder: Path = option("--folder", "Where cycles.csv goes.", FOLDER, default=Path("endurance")),
    go_on: bool = flag("--go-on", "Go on after the cycles that the folder has."),
    sim: bool = sim_option,
    effects: tuple[str, ...] = effect_option,
    seed: int = seed_option,
    lease: float = lease_option,
    bench: str = axis_option,
) -> None:
    """Cycle between two displacements or temperatures until a limit ends it.

    The cycles run in blocks. A block lasts at most three quarters of the longest armed time or of
    one file, begins from rest and has its own run log. FOLDER/cycles.csv has the statistics of
    every cycle. The disk space is printed and reserved first. A stop, a fault, or a failed check-up
    ends the run. Inspect the bench before you give --go-on, which includes what a killed run
    recorded.
    """
    from smad.config import Config, parse_config
    from smad.experiments.endurance import run
    from smad.experiments.endurance.judgement import checker
    from smad.experiments.endurance.limits import EndLimits
    from smad.experiments.live import LiveDriver
    from smad.experiments.ready import require_baseline, require_packages
    from smad.experiments.virtual import VirtualDriver

    require_packages("gap" if every else "sim")
    first = run.first_cycle(folder, go_on=go_on)
    if baseline is not None:
        require_baseline(baseline)
    settings = run.Endurance(
        profile=cycle.profile(),
        cycles=cycles,
        limits=EndLimits(**asdict(ends)),
        check_every=every[0] if every else 0,
        full_every=full_every,
        first=first,
    )
    driver: run.BlockDriver
    with contextlib.ExitStack() as stack:
        line = stack.enter_context(progress())
        if sim:
            driver = VirtualDriver(simulated_model(effects), seed=seed, folder=folder)
            config, logs = Config(), folder
        else:
            client = stack.enter_context(ready_client(bench))
            driver = LiveDriver(client, who="smad run endurance", lease_s=lease, progress=line.say)
            config = parse_config(client.config())
            logs = Path(client.status().recorder.folder)
        plan, room = run.prepared(settings, config, folder, logs, go_on=go_on, tell=click.echo)
        simulated = (seed, effects) if sim else None
        check = checker(baseline, folder, driver, bench, simulated) if baseline and every else None
        ended = run.endure(plan, driver, folder, room, logs=logs, check=check, say=line.say)
    for number, judgement in ended.judgements:
        click.echo(f"check-up after {counted(number, 'cycle')}: {judgement.headline}")
    click.echo(
        f"ended after {counted(ended.cycles, 'cycle')}: {ended.reason}; {folder / run.CYCLES_FILE}"
    )
