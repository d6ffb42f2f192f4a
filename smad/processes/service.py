"""The service files, and their installation below the root of the system."""

import sys
from collections.abc import Mapping
from pathlib import Path

from smad.errors import SmadError

PLACES: Mapping[str, str] = {
    "smad@.service": "etc/systemd/system",
    "smad-queue@.service": "etc/systemd/system",
    "smad-hooks@.service": "etc/systemd/system",
    "60-smad.rules": "etc/udev/rules.d",
}
"""File beside this module -> folder under the root of the system."""
PROGRAM = "/opt/smad/bin/smad"
"""What stands in the files for the program that they start."""


def content(name: str) -> str:
    """Return a service file that starts the `smad` of this Python."""
    program = str(Path(sys.prefix) / "bin" / "smad")
    return Path(__file__).with_name(name).read_text("utf-8").replace(PROGRAM, program)


def install(root: Path, *, overwrite: bool) -> list[Path]:
    """Write the files under `root` and return their paths; one that is there as it is stays.

    Raises SmadError when one is there that somebody changed, or cannot be written.
    """
    files = {root / place / name: content(name) for name, place in PLACES.items()}
    try:
        changed = [
            path for path, text in files.items() if path.exists() and path.read_text() != text
        ]
        if changed and not overwrite:
            raise SmadError(
                "a service file is there already and differs: somebody changed it, or it is older",
                value=str(changed[0]),
                action="compare it with smad service show, then give --overwrite",
            )
        for path, text in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
            path.chmod(0o644)
    except OSError as error:
        raise SmadError(
            f"the service files cannot be written ({error.strerror})",
            value=str(error.filename),
            action="run it with sudo",
        ) from None
    return list(files)
