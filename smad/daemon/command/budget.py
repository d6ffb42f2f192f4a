"""How much of a core the daemon may use once commands come in, so that a flood starves nothing.

What a command costs is spread over the loop: its bytes are read before it is served, and what it
waits for is answered afterwards. So the loop's whole processor time is charged, and commands wait
while it is above the share. A process of real-time priority that uses all of a core is stopped by
the kernel for 50 ms of each second (sched(7), sched_rt_runtime_us); the share keeps well away.

Pure: time is an argument. A token bucket that holds time instead of tokens.
"""


class TimeBudget:
    """Fills with `share` of the passing time, up to `burst_ns`; the loop's work empties it.

    When it is empty, `delay_ns` says how long to wait before the next command: at most `most_ns`,
    so that commands are served, slowly, even if the rest of the loop needs more than the share.
    """

    def __init__(self, share: float, burst_ns: int, most_ns: int) -> None:
        self.share = share
        self.burst_ns = burst_ns
        self.most_ns = most_ns
        self._left_ns = float(burst_ns)
        self._seen: tuple[int, int] | None = None

    def look(self, now_ns: int, worked_ns: int) -> None:
        """Take in the time, and the processor time that the loop has used up to it."""
        if self._seen is not None:
            gained_ns = (now_ns - self._seen[0]) * self.share - (worked_ns - self._seen[1])
            floor_ns = -self.most_ns * self.share
            self._left_ns = min(max(self._left_ns + gained_ns, floor_ns), float(self.burst_ns))
        self._seen = now_ns, worked_ns

    def delay_ns(self) -> int:
        """Return how long to wait until the budget is positive again; 0 when it is now."""
        return 0 if self._left_ns > 0 else int(-self._left_ns / self.share) + 1
