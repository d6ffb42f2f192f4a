"""The reference that a command will ask for, drawn before it is given, and how far limits are.

Pure. The same code places and refuses the pieces as in the controller (`ReferenceQueue`).
"""

from smad.config import LimitsConfig
from smad.control.commands import DriveCurrent, Follow, FollowInputs, HoldTemperature, Trajectory
from smad.control.plan import Do, Pause, Plan, UntilDone
from smad.control.trajectories import ReferenceQueue
from smad.errors import CommandError
from smad.view.replies import Preview

POINTS = 1500
"""Of a drawing. A motion of more turns than these show fills the band between its extremes."""
MM = 1e-3
_OTHER_MODES = (DriveCurrent, FollowInputs, HoldTemperature)


def drawn(
    piece: Trajectory, from_mm: float, limits: LimitsConfig, handover_rate_mm_per_s: float
) -> Preview:
    """Return a piece of motion, for a reference that stands at `from_mm` before it."""
    queue = ReferenceQueue(limits, handover_rate_mm_per_s)
    queue.restart(from_mm * MM)
    title = type(piece).__name__
    try:
        queue.follow(Follow(trajectories=(piece,)))
    except CommandError as refused:
        return Preview(title=title, t_s=[], mm=[], words=str(refused), refused=True)
    t_s, mm = _followed(queue, 0.0)
    return Preview(title=title, t_s=t_s, mm=[*mm], words=_words(t_s[-1], mm, limits))


def planned(plan: Plan, limits: LimitsConfig, handover_rate_mm_per_s: float) -> Preview:
    """Return a run of an experiment: its reference, and how long it is at most."""
    queue = ReferenceQueue(limits, handover_rate_mm_per_s)
    at_s, at_most = 0.0, False
    t_s: list[float] = []
    mm: list[float | None] = []
    last_mm: float | None = None
    for number, action in enumerate(plan.actions):
        if isinstance(action, Do) and isinstance(action.command, Follow):
            try:
                queue.follow(action.command)
            except CommandError as refused:
                return Preview(title=plan.name, t_s=[], mm=[], words=str(refused), refused=True)
            times, values = _followed(queue, at_s)
            t_s, mm = [*t_s, *times], [*mm, *values]
            last_mm = values[-1]
            queue.advance(times[-1] - at_s)
            at_s = times[-1]
        elif isinstance(action, Do) and isinstance(action.command, _OTHER_MODES):
            # They follow no displacement; one without a duration ends by a reading.
            known_s = getattr(action.command, "duration_s", None)
            at_most = at_most or known_s is None
            t_s, mm, last_mm = [*t_s, at_s], [*mm, None], None
            at_s += _patience_s(plan, number) if known_s is None else known_s
            queue.restart(0.0)
        elif isinstance(action, Pause):
            at_s += action.seconds
            if last_mm is not None:
                t_s, mm = [*t_s, at_s], [*mm, last_mm]
            queue.advance(action.seconds)
    values = [value for value in mm if value is not None]
    words = _words(at_s, values, limits)
    mounted = f"springs {plan.fixture}, in {plan.cooling}; "
    return Preview(
        title=plan.name, t_s=t_s, mm=mm, words=mounted + ("at most " if at_most else "") + words
    )


def _patience_s(plan: Plan, number: int) -> float:
    """How long the plan waits for what action `number` begins."""
    later = plan.actions[number + 1 :]
    return next((action.timeout_s for action in later if isinstance(action, UntilDone)), 0.0)


def _followed(queue: ReferenceQueue, begin_s: float) -> tuple[list[float], list[float]]:
    """Times and reference until the last piece ends, in mm."""
    length_s = queue.remaining_s
    steps = [length_s * k / POINTS for k in range(POINTS + 1)]
    # At the very end the reference is where it stays.
    values = [queue.peek(min(step, length_s)) / MM for step in steps]
    return [round(begin_s + step, 4) for step in steps], [round(value, 4) for value in values]


def _words(length_s: float, mm: list[float], limits: LimitsConfig) -> str:
    minutes = f" ({length_s / 60:.0f} min)" if length_s >= 120 else ""
    text = f"{length_s:.4g} s{minutes}"
    if not mm:
        return f"{text}; no displacement is followed"
    furthest = max(map(abs, mm))
    margin = limits.displacement_max_mm - furthest
    low, high = f"{min(mm):.2f}", f"{max(mm):.2f}"
    where = f"at {low}" if low == high else f"from {low} to {high}"
    return f"{text}; {where} mm, {margin:.2f} mm to the limit of {limits.displacement_max_mm:g} mm"
