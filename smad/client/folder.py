"""Where the daemon of a bench records."""

from pathlib import Path

from smad.client.blocking import Client
from smad.errors import SmadError


def recording_folder(bench: str, timeout_s: float = 1.0) -> Path | None:
    """Return the folder of the daemon's run logs; None while none answers."""
    try:
        with Client(bench, timeout_s=timeout_s) as client:
            folder = client.status().recorder.folder
    except SmadError:
        return None
    return Path(folder) if folder else None
