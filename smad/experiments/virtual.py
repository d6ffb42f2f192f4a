"""Plans in virtual time, on the simulated bench."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from firmware_protocol.messages import Setpoint, State
from firmware_protocol.nearest import instead
from sim_device.plant import Drive
from sim_device.plant.models import Model
from sim_device.plant.parameters import parameters_text
from smad.config import Config, config_to_toml
from smad.control.controller import Controller
from smad.control.cooling import PumpStarts
from smad.control.errors import BenchStoppedError, PlanError
from smad.control.plan import Plan
from smad.control.runner import run_virtual
from smad.control.sample import Sample
from smad.experiments.driver import PARTS, Mounting, log_name, log_path
from smad.experiments.errors import EndedEarlyError, ExperimentError, TrippedError
from smad.experiments.recording import Recording
from smad.progress import Say
from smad.runlog.reader import columns_of
from smad.runlog.rows import row_of
from smad.runlog.schema import Event, Record, Row


@dataclass(eq=False)
class VirtualDriver:
    """A simulated bench for each plan, fresh but for its `past`, and at rest.

    `seed` and the name of the plan decide the noise, so that runs differ and repeat. `lacking`
    takes parts away, as on a bench without them (ExperimentError for one that is not in `PARTS`).
    `past` says for how many seconds each drive is held before a plan. With `folder` each run is
    also written there as a run log. `cycles` are those that each spring has behind it at the next
    run, and has after it; `log` is where the last one was written.
    """

    model: Model
    _: KW_ONLY
    config: Config = field(default_factory=Config)
    seed: int = 0
    lacking: frozenset[str] = frozenset()
    folder: Path | None = None
    progress: Say | None = None
    past: Sequence[tuple[float, Drive]] = ()
    cycles: tuple[float, float] = field(default=(0.0, 0.0), init=False)
    log: Path | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        if unknown := sorted(self.lacking - set(PARTS)):
            raise ExperimentError(
                "the simulated bench has no such part to remove",
                value=", ".join(unknown),
                action=instead(unknown[0], PARTS, f"they are {', '.join(PARTS)}"),
            )

    def parts(self) -> frozenset[str]:
        return frozenset(PARTS) - self.lacking

    def mounting(self) -> Mounting | None:
        return None

    def record(self, plan: Plan, action: str) -> Path:
        """As `run`, into a run log that is not there yet. Raises ExperimentError with `action`."""
        assert self.folder is not None
        if (path := log_path(self.folder, plan)).exists():
            cause = "a run log of that name is there already"
            raise ExperimentError(cause, value=str(path), action=action)
        self.run(plan)
        return path

    def run(self, plan: Plan) -> Recording:
        from sim_device.bench import SimulatedBench
        from sim_device.plant.errors import PlantError
        from smad.runlog.paths import make_folder

        if self.folder is not None:
            # First, since nobody wants to be told after minutes of simulation.
            make_folder(self.folder)

        seed = (self.seed + zlib.crc32(plan.name.encode())) & 0xFFFF_FFFF
        rows: list[Row] = []
        pump_starts = PumpStarts()

        def record(
            sample: Sample, state: State, setpoint: Setpoint, reference_m: float, target: float
        ) -> None:
            rows.append(
                row_of(
                    sample,
                    state,
                    setpoint,
                    host_time_s=float("nan"),
                    reference_m=reference_m,
                    reference_degC=target,
                    pump_starts=pump_starts.step(sample.pump_duty),
                )
            )

        def tell(board_time_s: float) -> None:
            if self.progress is not None and int(board_time_s) % 20 == 0:
                self.progress(f"{plan.name}: {board_time_s:.0f} s of board time")

        controller = Controller(self.config.control, self.config.limits)
        try:
            bench = SimulatedBench(
                **self.model.physics,
                fixture=plan.fixture,
                cooling=plan.cooling,
                rate_hz=self.config.link.rate_hz,
                seed=seed,
            )
            bench.plant.cycles = self.cycles
            for held_s, drive in self.past:
                bench.plant.advance(drive, held_s)
            done = run_virtual(bench, controller, plan, recorder=record, progress=tell)
            self.cycles = bench.plant.cycles
        except PlanError as error:
            if self.folder is not None:
                self._write(plan, rows, {}, seed)
            kind = TrippedError if isinstance(error, BenchStoppedError) else ExperimentError
            raise kind(f"run {plan.name}: {error.cause}", **error.parts) from None
        except PlantError as error:
            raise ExperimentError(
                f"run {plan.name}: the simulated bench gave up: {error}",
                action="check the parameter file and the effects",
            ) from None
        if self.folder is not None:
            self._write(plan, rows, done.marks, seed)
        if controller.departure is not None:
            raise EndedEarlyError(
                f"run {plan.name} was ended: {controller.departure.in_words()}",
                action="what was recorded until then is kept",
            )
        columns = {name: np.asarray(column, float) for name, column in columns_of(rows).items()}
        return Recording(columns, done.marks)

    def _write(self, plan: Plan, rows: list[Row], marks: Mapping[str, float], seed: int) -> None:
        from smad.runlog.header import RunHeader, installed_versions
        from smad.runlog.writer import write_run

        assert self.folder is not None
        path = log_path(self.folder, plan)
        path.unlink(missing_ok=True)
        self.log = path
        header = RunHeader(
            source="sim",
            name=log_name(plan),
            rate_hz=float(self.config.link.rate_hz),
            seed=seed,
            repeats=plan.repeats,
            configuration=config_to_toml(self.config),
            parameter_file=parameters_text(self.model.parameters),
            versions=installed_versions(),
            extra={"plan": msgspec.json.encode([repr(action) for action in plan.actions]).decode()},
        )
        events = [
            Event(t_s=at_s, kind="note", text=f"{MARK}{name}") for name, at_s in marks.items()
        ]
        records: list[Record] = [*rows, *events]
        write_run(path, header, records)


MARK = "mark "
"""How the text of a note begins that marks a moment of a plan."""
