"""A folder that an export writes: whole or not at all."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from smad.errors import RunLogError, refused_by_system


@contextlib.contextmanager
def whole_folder(target: Path, marker: str, what: str, *, overwrite: bool) -> Iterator[Path]:
    """Yield a folder of that name to fill, which takes the place of `target` in the end.

    Raises RunLogError for a `target` that is there; with `overwrite` for one without the file
    `marker`, which is no `what`; and where the disk refuses.
    """
    if target.exists() and not overwrite:
        raise RunLogError(f"{target} is there already", action="use --overwrite or another name")
    if target.exists() and not (target / marker).is_file():
        raise RunLogError(
            f"{target} is not a {what}, and is not replaced by one", action="name another folder"
        )
    with refused_by_system(RunLogError, f"cannot write {target}", action="check folder and space"):
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent, prefix=".smad-") as name:
            folder = Path(name) / target.name
            yield folder
            if target.exists():
                shutil.rmtree(target)
            os.replace(folder, target)
