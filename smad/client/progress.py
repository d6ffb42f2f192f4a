"""When a wait for a motion is over, or will never be. Pure: time is an argument."""

from smad.api import Motion
from smad.client.errors import NoAnswer, Stopped


class Wait:
    """Judges each poll of a motion. `generation` is the one we armed in, if we did."""

    def __init__(
        self, now_s: float, timeout_s: float | None, generation: int | None = None
    ) -> None:
        self._began_s = now_s
        self._timeout_s = timeout_s
        self._generation = generation

    def over(self, motion: Motion, now_s: float, *, ours: bool = True) -> bool:
        """Return whether the motion is done; `ours`: nobody has commanded another one since.

        Raises Stopped when the board is not armed any more, or was stopped and armed by somebody
        else since, and when the motion is not ours; NoAnswer when the time is over.
        """
        since = self._generation is not None and motion.generation != self._generation
        if since and motion.armed:
            raise Stopped(
                "the motion ended early: the bench was stopped, and has been armed again since",
                action="see smad status for what happened; disarm, arm and start again",
            )
        fault = motion.fault
        if not motion.armed or since or fault is not None:
            raise Stopped(
                "the motion ended early: "
                + (
                    f"the {fault.by} stopped with {fault.name}"
                    if fault
                    else motion.ended or "the bench is not armed"
                ),
                value=f"board in {motion.mode}",
                action="smad faults explain says what to do"
                if fault
                else "see smad status for what happened; arm and start again",
            )
        if not ours:
            raise Stopped(
                "the motion ended early: another client ended or replaced it",
                value=f"mode {motion.running}",
                action="see smad status, agree with who commands it, and start again",
            )
        if motion.ended:
            raise Stopped(
                f"the motion ended early: {motion.ended}",
                action="the bench is idle; see what changed before it is repeated again",
            )
        if motion.done:
            return True
        if self._timeout_s is not None and now_s - self._began_s > self._timeout_s:
            raise NoAnswer(
                "the motion is not done yet",
                limit=f"{self._timeout_s:g} s",
                action="wait longer, or end it with idle() or disarm()",
            )
        return False
