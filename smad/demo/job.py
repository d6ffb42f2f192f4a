"""What the demo does to the bench: a ±10 mm step cycle, then a 2 mm sinusoid of 7 s."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

from smad.api import Motion, Status
from smad.client import BoardRefused, Client, NoAnswer, NotReady, Refused, Stopped
from smad.client.arming import arm_when_allowed
from smad.control.commands import Hold, Sine, Step, Trajectory
from smad.errors import SmadError
from smad.progress import Say

STEP_MM = 10.0
DWELL_S = 20.0
REST_S = 10.0
AMPLITUDE_MM = 2.0
PERIOD_S = 7.0
CYCLES = 4
ARM_DEADLINE_S = 120.0
_CAUSES = ("sent nothing", "stopped", "lost", "lapsed", "restarted")
"""Words of an event that is the cause of a stop, and does not follow from it."""

CYCLE: tuple[Trajectory, ...] = (
    Step(displacement_mm=STEP_MM, duration_s=DWELL_S),
    Step(displacement_mm=-STEP_MM, duration_s=DWELL_S),
    Step(displacement_mm=0.0, duration_s=DWELL_S),
    Sine(amplitude_mm=AMPLITUDE_MM, period_s=PERIOD_S, cycles=CYCLES),
    Hold(duration_s=REST_S),
)
LENGTH_S = 3 * DWELL_S + PERIOD_S * CYCLES + REST_S


@dataclass(frozen=True)
class Done:
    """What the job left: the run log's path, and the daemon's status at its end."""

    path: str
    status: Status


def run_cycle(client: Client, say: Say) -> Done:
    """Arm, record, run the cycle, disarm. Raises SmadError when the bench stops early."""
    client.as_of(client.motion().generation)
    arm_when_allowed(client, ARM_DEADLINE_S, lambda: say("waiting until the board can be armed"))
    began_s = client.motion().board_time_s
    recorder = client.start_recording("demo")
    client.move(*CYCLE)

    def progress(motion: Motion) -> None:
        say(f"{motion.board_time_s - began_s:.0f} of {LENGTH_S:.0f} s of board time")

    client.wait_until_done(progress)
    status = client.status()
    client.disarm()
    client.stop_recording()
    return Done(recorder.path, status)


def measured(client: Client, seconds: float, say: Say) -> Status | str:
    """Move gently for so long by the wall clock; return the status then, or why it cannot be.

    What is measured is delay by the wall clock, so a board that is kept from running on a busy
    machine is judged by it; the demo itself has been carried out by then.
    """
    try:
        arm_when_allowed(client, ARM_DEADLINE_S, lambda: say("waiting until it can be armed"))
        client.move(Sine(amplitude_mm=1.0, period_s=seconds, cycles=1))
        client.wait_until_done(lambda motion: say("measuring the setpoint's age in real time"))
        status = client.status()
        client.disarm()
        return status
    except (Stopped, Refused, NoAnswer) as error:
        return _why(client) or error.cause


@contextlib.contextmanager
def naming_cause(client: Client) -> Iterator[None]:
    """Give an error of the bench the words of the daemon's journal, while there is one to ask."""
    try:
        yield
    except (Stopped, NotReady, BoardRefused, NoAnswer) as error:
        why = "" if isinstance(error, NoAnswer) else _why(client)
        if why and why not in error.cause:
            error.cause = f"{error.cause}: {why}"
        error.action = "a busy machine may be the cause; run the demo again"
        raise


def _why(client: Client) -> str:
    """What the daemon's journal says last of what stopped the bench; empty: nothing."""
    with contextlib.suppress(SmadError):
        events = [entry.text for entry in client.status().events]
        words = [text for text in events if any(cause in text for cause in _CAUSES)]
        return words[-1] if words else ""
    return ""
