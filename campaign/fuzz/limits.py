"""What one input may take: CPU time and memory. More is a finding, as an exception is."""

from __future__ import annotations

import contextlib
import resource
import time
import traceback
from pathlib import Path

from campaign.fuzz.program import Defect, require
from campaign.fuzz.targets import Harness

FINDINGS = "findings"
"""Folder, within that of a run, of the inputs that broke a promise."""

ALLOWED_MIB = 320
"""By which one input may raise the highest memory of its process; a log's chunk may take much."""

_TRIES = 3
"""How often an input that takes too long is run: imports of the first input, or other work of the
machine, may have cost the time. The shortest one counts."""

_OWN = Path(__file__).parent
_CLEAR_REFS = Path("/proc/self/clear_refs")


def within_limits(run: Harness, allowed_s: float) -> Harness:
    """Return `run` with a Defect for an input that takes too much time or memory."""

    def limited(data: bytes) -> None:
        _forget_the_peak()
        before_KiB = _peak_KiB()
        took_s = _took_s(run, data)
        grew_MiB = (_peak_KiB() - before_KiB) / 1024
        for _ in range(_TRIES - 1):
            if took_s > allowed_s:
                took_s = min(took_s, _took_s(run, data))
        require(took_s <= allowed_s, "took {:.1f} s of {} s allowed", took_s, allowed_s)
        require(
            grew_MiB <= ALLOWED_MIB,
            "took {:.0f} MiB of {} MiB allowed",
            grew_MiB,
            ALLOWED_MIB,
        )

    return limited


def _took_s(run: Harness, data: bytes) -> float:
    before_s = time.process_time()
    run(data)
    return time.process_time() - before_s


def _peak_KiB() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _forget_the_peak() -> None:
    """The peak is what is resident now, whatever the process took before (proc(5), clear_refs)."""
    with contextlib.suppress(OSError):
        _CLEAR_REFS.write_text("5")


def kind_of(error: BaseException) -> str:
    """Return what tells one defect from another: its type and where it was raised.

    For a broken promise that is the harness's sentence, for an exception the innermost line that
    is not the harness's.
    """
    frames = traceback.extract_tb(error.__traceback__)
    if isinstance(error, Defect):
        line = next(frame for frame in reversed(frames) if frame.name != "require")
    else:
        line = next((f for f in reversed(frames) if _is_ours(f.filename)), frames[-1])
    return f"{type(error).__name__} at {Path(line.filename).name}:{line.lineno}"


def _is_ours(filename: str) -> bool:
    path = Path(filename)
    return "site-packages" not in path.parts and _OWN.parents[1] in path.parents
