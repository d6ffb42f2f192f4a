"""Power losses: `python -m tests.smad.queue.power --trials 200 --seed 1` (needs root, for mounts).

A writer changes a queue on an ext4 file system in a loop device and says each change only after
its commit has returned. At a random instant the block device is copied as it is, which is what a
power loss leaves: what the kernel had not written is gone. The copy is mounted, and its queue must
hold every change that was said, undamaged.
"""

from __future__ import annotations

import argparse
import contextlib
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from smad.queue import machine
from smad.queue.machine import Readiness
from smad.queue.states import Arming, Item, State
from smad.queue.store import FILE, Store

SIZE_MB = 12
LATEST_S = 0.8
_MODULE = "tests.smad.queue.power"


class NoMount(Exception):
    """File systems cannot be mounted here."""


@dataclass(frozen=True)
class Loss:
    """What was said before a power loss, and what the disk holds after it."""

    said_ended: int
    said_running: int
    ended: int
    running: int

    @property
    def lost(self) -> bool:
        """Whether a change that was said is not on the disk."""
        return self.ended < self.said_ended or self.ended + self.running < self.said_running


def write(folder: Path, synchronous: str) -> None:
    """Run items without end; say `N running` before each would act, `N ended` after it is over."""
    with Store(folder / FILE) as store:
        if synchronous:
            store._db.execute(f"PRAGMA synchronous={synchronous}")
        print("begun", flush=True)
        while True:
            item = Item(id=0, position=0.0, kind="run", title="x" * 200, words=("run",))
            (item,) = store.add([item])
            arming = Arming(items=(item.id,), end_unix_s=1e12, longest_s=1e12)
            store.change(lambda s, arming=arming: machine.resumed(s, arming))  # type: ignore[misc]
            store.change(lambda s: machine.step(s, 0.0, Readiness(True)))
            print(f"{item.id} running", flush=True)
            store.change(lambda s, number=item.id: machine.ended(s, number, 0, 1.0))  # type: ignore[misc]
            print(f"{item.id} ended", flush=True)
            store.change(lambda s: machine.step(s, 0.0, Readiness(True)))


@contextlib.contextmanager
def mounted(image: Path, at: Path) -> Iterator[None]:
    """Mount an image as long as the block lasts. Raises NoMount."""
    at.mkdir(exist_ok=True)
    done = subprocess.run(
        ["mount", "-o", "loop", str(image), str(at)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise NoMount(done.stderr.strip())
    try:
        yield
    finally:
        subprocess.run(["umount", str(at)], check=True)


def lose_power(folder: Path, seed: int, synchronous: str = "") -> Loss:
    """Cut the power of a writer at an instant that the seed draws; return what is left."""
    draw = random.Random(seed)
    image, copy = folder / "disk", folder / "after"
    with image.open("wb") as file:
        file.truncate(SIZE_MB * 1_000_000)
    made = subprocess.run(["mkfs.ext4", "-q", str(image)], capture_output=True, check=False)
    if made.returncode:
        raise NoMount("no mkfs.ext4")
    with mounted(image, folder / "mount"):
        writer = subprocess.Popen(
            [sys.executable, "-m", _MODULE, "--write", str(folder / "mount"), synchronous],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert writer.stdout is not None
            assert writer.stdout.readline() == "begun\n"
            time.sleep(draw.uniform(0.0, LATEST_S))
            writer.send_signal(signal.SIGSTOP)
            shutil.copyfile(image, copy)
        finally:
            writer.kill()
            said, _ = writer.communicate()
    lines = [line.split() for line in said.splitlines() if line.count(" ") == 1]
    counts = {word: sum(line[1] == word for line in lines) for word in ("ended", "running")}
    with mounted(copy, folder / "mount"), Store(folder / "mount" / FILE) as store:
        (integrity,) = store._db.execute("PRAGMA integrity_check").fetchone()
        assert integrity == "ok", integrity
        states = [item.state for item in store.snapshot().items]
    return Loss(
        counts["ended"],
        counts["running"],
        states.count(State.DONE),
        states.count(State.RUNNING),
    )


def main() -> int:
    """Lose the power so many times; print what was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--folder", type=Path, default=Path("power"))
    parser.add_argument("--write", nargs=2, metavar=("FOLDER", "SYNCHRONOUS"))
    options = parser.parse_args()
    if options.write:
        write(Path(options.write[0]), options.write[1])
    options.folder.mkdir(parents=True, exist_ok=True)
    losses = [lose_power(options.folder, options.seed + n) for n in range(options.trials)]
    lost = sum(loss.lost for loss in losses)
    print(
        f"{len(losses)} power losses, seeds {options.seed} to {options.seed + len(losses) - 1}: "
        f"{sum(loss.said_running for loss in losses)} items were said to run, "
        f"changes lost in {lost}, files damaged in 0"
    )
    return int(lost > 0)


if __name__ == "__main__":
    sys.exit(main())
