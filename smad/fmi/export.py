"""A model file as an FMI 2.0 co-simulation unit."""

from __future__ import annotations

import contextlib
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import msgspec

from sim_device.plant.models import Model, write_model
from smad.extras import part
from smad.files import replacing
from smad.fmi.errors import FmiError
from smad.fmi.pair import MODEL, MOUNTED, Mounted

_SCRIPT = Path(__file__).with_name("unit_script.py")


def export_unit(
    model: Model, target: Path, *, mounted: Mounted | None = None, overwrite: bool = False
) -> Path:
    """Write the plant of `model` to `target`, a file that ends in `.fmu`; returns it.

    Raises FmiError for a name that does not end so, a file that is there, and a folder that cannot
    be written; MissingPartError without pythonfmu.
    """
    if target.suffix != ".fmu":
        raise FmiError(
            "a unit of FMI is a file that ends in .fmu", value=target.name, action="name it so"
        )
    if target.exists() and not overwrite:
        raise FmiError(f"{target} is there already", action="use --overwrite or another name")
    builder = part("pythonfmu.builder").FmuBuilder
    with tempfile.TemporaryDirectory(prefix="smad-fmu-") as name:
        # pythonfmu puts the folder of the script on the path of modules: one with nothing else.
        folder = Path(name)
        script = folder / "script" / "spring_pair.py"
        script.parent.mkdir()
        shutil.copyfile(_SCRIPT, script)
        write_model(folder / MODEL, model)
        (folder / MOUNTED).write_bytes(msgspec.json.encode(mounted or Mounted()))
        made = folder / "made.fmu"
        with _modules_as_before():
            builder.build_FMU(script, dest=made, project_files={folder / MODEL, folder / MOUNTED})
        _move(made, target)
    return target


def _move(made: Path, target: Path) -> None:
    try:
        with replacing(target) as partial:
            shutil.copyfile(made, partial)
    except OSError as error:
        raise FmiError(
            f"cannot write {target}: {error.strerror or error}", action="check folder and space"
        ) from error


@contextlib.contextmanager
def _modules_as_before() -> Iterator[None]:
    path, modules = list(sys.path), set(sys.modules)
    try:
        yield
    finally:
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if name == "spring_pair":
                del sys.modules[name]
