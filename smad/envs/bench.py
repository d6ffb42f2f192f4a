"""A policy on a bench: through a client, under all limits of board and host, logged as a run."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from smad.arrays import Array, Singles
from smad.client import Client, NotInControl
from smad.control.commands import DriveCurrent
from smad.envs import references, signals
from smad.envs.errors import ActionRefused, EnvError, PolicyFailed
from smad.runlog.schema import Row

Policy = Callable[[Singles], npt.ArrayLike]
LEASE_S = 2.0
STALE_S = 0.2
"""After a policy that took longer, the samples that have come meanwhile are left out."""
_REFERENCE_STEP_S = 0.01
_OFF = DriveCurrent(i_x_A=0.0, i_y_A=0.0)


@dataclass(frozen=True, kw_only=True)
class BenchRun:
    """What a policy did on a bench.

    path: the run log. t_s, displacement_mm, reference_mm (n,): as seen at each answer.
    late: how often the policy took longer than `STALE_S`.
    """

    path: str
    t_s: Array
    displacement_mm: Array
    reference_mm: Array
    late: int

    @property
    def rms_mm(self) -> float:
        """Root mean square of what the displacement is off the reference, mm."""
        return float(np.sqrt(np.mean((self.displacement_mm - self.reference_mm) ** 2)))


class Answering:
    """From a sample of the bench to the command that answers it: no sockets, no clock."""

    def __init__(
        self,
        policy: Policy,
        *,
        action: str = "currents",
        reference: str | references.Reference = "sines",
        duration_s: float = 20.0,
        seed: int = 0,
    ) -> None:
        signals.action_range(action)
        if not 0.1 <= duration_s <= 3600.0:
            raise EnvError("duration_s out of range", value=duration_s, limit="0.1 to 3600")
        self._policy, self._action, self._duration_s = policy, action, duration_s
        steps = round((duration_s + signals.PREVIEW_S) / _REFERENCE_STEP_S) + 1
        self._times: Array = np.arange(steps, dtype=np.float64) * _REFERENCE_STEP_S
        self._positions = references.drawn(reference, np.random.default_rng(seed), self._times)
        self._start_s: float | None = None
        self._seen = np.zeros(len(signals.NAMES))
        self.trace: list[tuple[float, float, float]] = []

    def answer(self, row: Row) -> DriveCurrent | None:
        """What the policy wants at a sample; None when its time is over.

        A sensor without a value keeps its last one. Raises PolicyFailed.
        """
        if self._start_s is None:
            self._start_s = row.t_s
        t_s = row.t_s - self._start_s
        if t_s >= self._duration_s:
            return None
        for i, name in enumerate(signals.MEASURED):
            value = getattr(row, name)
            if value is not None and np.isfinite(value):
                self._seen[i] = value
        ahead = t_s + signals.PREVIEW_S
        self._seen[-2:] = np.interp([t_s, ahead], self._times, self._positions)
        self.trace.append((t_s, float(self._seen[0]), float(self._seen[-2])))
        seen = np.clip(self._seen.astype(np.float32), signals.LOW, signals.HIGH)
        return self._command(seen)

    def _command(self, seen: Singles) -> DriveCurrent:
        try:
            action = np.asarray(self._policy(seen), dtype=np.float64)
            i_x, i_y, duty_x, duty_y = signals.driven(self._action, action[None], 1)[0].tolist()
        except ActionRefused:
            raise
        except Exception as error:
            raise PolicyFailed(
                "the policy failed, and the bench is disarmed",
                value=f"{type(error).__name__}: {error}",
                action="correct the policy; try it in the environment first",
            ) from error
        return DriveCurrent(i_x_A=i_x, i_y_A=i_y, pump_x_duty=duty_x, pump_y_duty=duty_y)


def on_bench(
    policy: Policy,
    *,
    client: Client | None = None,
    action: str = "currents",
    reference: str | references.Reference = "sines",
    duration_s: float = 20.0,
    seed: int = 0,
    name: str = "policy",
    lease_s: float = LEASE_S,
    clock: Callable[[], float] = time.monotonic,
) -> BenchRun:
    """Let a policy drive a bench for `duration_s`, and record it as a run.

    policy: from an observation of the environment (`signals.NAMES`) to an action of the kind
    `action`. client: of the bench's daemon, by default the one on this machine. seed: draws the
    reference. Arms the bench and disarms it at the end. All of the bench's limits, stops and its
    lease act as for any client: while the policy thinks, the last currents stay; when it is silent
    for `lease_s`, the daemon disarms the bench and the next command is refused.

    Raises ActionRefused, PolicyFailed, and what the client raises.
    """
    with ExitStack() as stack:
        bench = stack.enter_context(Client()) if client is None else client
        answering = Answering(
            policy, action=action, reference=reference, duration_s=duration_s, seed=seed
        )
        # Not renewed in the background: a policy may think for ever.
        stack.enter_context(bench.in_control(name, lease_s, renewed=False))
        stack.enter_context(bench.armed())
        bench.start_recording(name)
        try:
            late = _drive(bench, answering, clock)
        except NotInControl:
            # The lease has lapsed and the bench is disarmed; without control its run would go on.
            bench.take_control(name, lease_s)
            raise
        except BaseException:
            # First of all: a slow disk may take its time to close the log.
            bench.idle()
            raise
        finally:
            recorded = bench.stop_recording()
    t_s, seen, reference_mm = np.array(answering.trace).reshape(-1, 3).T
    return BenchRun(
        path=str(recorded.path), t_s=t_s, displacement_mm=seen, reference_mm=reference_mm, late=late
    )


def _drive(client: Client, answering: Answering, clock: Callable[[], float]) -> int:
    """Answer samples until the time is over; returns how often the policy was late."""
    late = 0
    samples = client.telemetry()
    while True:
        row = next(samples)
        begun_s = clock()
        command = answering.answer(row)
        if command is None:
            # Refused, if the bench was stopped while the policy thought for the last time.
            client.current(_OFF)
            return late
        client.current(command)
        if clock() - begun_s > STALE_S:
            late += 1
            samples = client.telemetry()
