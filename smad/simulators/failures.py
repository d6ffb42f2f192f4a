"""Replays that gave no numbers, as a verdict has them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field


@dataclass
class Failures:
    """Replays that gave no numbers: how many, and why the first did; and of each effect how many
    gave numbers and how many did not."""

    replays: int = 0
    failed: int = 0
    why: str = ""
    of_effects: dict[str, list[int]] = field(default_factory=dict)

    def add(self, why: str) -> None:
        """A replay that failed; why the first one did is kept."""
        self.failed += 1
        self.why = self.why or why

    def count(self, effects: Iterable[str], *, failed: bool) -> None:
        """A replay with these effects."""
        for name in effects:
            self.of_effects.setdefault(name, [0, 0])[failed] += 1

    @property
    def notes(self) -> list[str]:
        """What is said of them in a verdict; nothing where there were none."""
        if not self.failed:
            return []
        never = [n for n, (good, bad) in self.of_effects.items() if bad and not good]
        lost = [f"no replay with {', '.join(never)} gave numbers: no rival"] if never else []
        return [
            f"{self.failed} of {self.replays} replays gave no numbers, and what they were of was "
            f"dropped: {self.why}",
            *lost,
        ]
