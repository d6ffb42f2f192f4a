"""A recorded run played again: on a fresh simulated bench, or on that of a client."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sim_device.plant.models import built_in
from smad.config import Config, parse_config
from smad.experiments.errors import EndedEarlyError, StoppedError, TrippedError
from smad.experiments.live import LiveDriver
from smad.experiments.repeating import RecordedInputs
from smad.experiments.replayer import InPlaceDriver, RestFirstDriver
from smad.experiments.virtual import VirtualDriver
from smad.progress import Say

if TYPE_CHECKING:
    from smad.client import Client


def repeat_simulated(
    recorded: RecordedInputs, folder: Path, seed: int, *, say: Say, progress: Say
) -> Path:
    """Play a run on the nominal simulated bench in virtual time; return its new run log.

    `say` gets the path of the log when it ends early. Raises RepeatError, ExperimentError.
    """
    recorded.require_fit(Config())
    driver = VirtualDriver(built_in("A"), seed=seed, folder=folder, progress=progress)
    with _saying_where(driver, say):
        action = "give another folder with --save-logs, or move it away"
        return driver.record(recorded.plan(), action)


def repeat_on(
    client: Client,
    recorded: RecordedInputs,
    *,
    bench: str,
    lease_s: float,
    as_is: bool,
    other_bench: bool,
    say: Say,
    progress: Say,
) -> Path:
    """Play a run on the bench of a client that is ready to arm; return its new run log.

    Begins where the run began, or with `as_is` where the bench is. Raises as `repeat_simulated`,
    and RepeatError for a run of another bench unless `other_bench`.
    """
    recorded.require_fit(parse_config(client.config()))
    if not other_bench:
        board = client.status().board
        recorded.require_bench("" if board is None else board.uid, bench)
    live: dict[str, Any] = {"who": "smad run repeat", "lease_s": lease_s, "progress": progress}
    driver = (
        InPlaceDriver(client, **live)
        if as_is
        else RestFirstDriver(client, start=recorded.start, **live)
    )
    with _saying_where(driver, say):
        driver.run(recorded.plan())
    assert driver.log is not None
    return driver.log


@contextlib.contextmanager
def _saying_where(driver: LiveDriver | VirtualDriver, say: Say) -> Iterator[None]:
    try:
        yield
    except (EndedEarlyError, StoppedError, TrippedError):
        if driver.log is not None:
            say(f"recorded until then: {driver.log}")
        raise
