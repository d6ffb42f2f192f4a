"""A model file as a co-simulation unit of FMI 3.0 or 2.0: C source, and a binary where a compiler
is.

The importing machine needs neither Python nor smad. docs/decisions/0912 compares the ways.
"""

import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

from sim_device.plant.models import Model, write_model
from smad.files import named_output
from smad.fmi.description import IDENTIFIER, SOURCE, build_description, description
from smad.fmi.errors import FmiError
from smad.fmi.kernel_c import kernel_source
from smad.fmi.variables import variables

MODEL = "model.toml"
_WRITTEN = Path(__file__).with_name("unit")
# No operation is fused, so that a unit computes what the simulator does.
_FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-fvisibility=hidden", "-shared", "-fPIC")
_FOLDERS = {
    2: {"Linux-x86_64": "linux64"},
    3: {"Linux-x86_64": "x86_64-linux", "Linux-aarch64": "aarch64-linux"},
}


@dataclass(frozen=True, kw_only=True)
class Mounted:
    """What a model file does not say: the fixture, and what cools."""

    fixture: str = "antagonistic"
    cooling: str = "water"


@dataclass(frozen=True)
class Exported:
    """The unit, and the platform that it has a binary for ("" for none: source only)."""

    path: Path
    platform: str


def export_unit(
    model: Model,
    target: Path,
    *,
    version: int = 3,
    mounted: Mounted | None = None,
    overwrite: bool = False,
) -> Exported:
    """Write the plant of `model` to `target`, a file that ends in `.fmu`.

    version: 3 for FMI 3.0, 2 for 2.0. A binary lies inside where this machine has a C compiler
    (`cc`, or what CC names). Raises FmiError for a name that does not end so, a file that is there,
    a compiler that fails, and a folder that cannot be written.
    """
    if target.suffix != ".fmu":
        raise FmiError(
            "the name of an FMI unit ends with .fmu", value=target.name, action="name it so"
        )
    if target.exists() and not overwrite:
        raise FmiError(f"{target} is there already", action="use --overwrite or another name")
    with tempfile.TemporaryDirectory(prefix="smad-fmu-") as name:
        folder = Path(name)
        write_sources(model, folder, version, mounted or Mounted())
        (folder / "resources").mkdir()
        write_model(folder / "resources" / MODEL, model)
        built_for = compile_unit(folder, version)
        _pack(folder, target)
    return Exported(target, built_for)


def write_sources(model: Model, folder: Path, version: int, mounted: Mounted) -> None:
    """Write the description and the sources of a unit to `folder`."""
    sources = folder / "sources"
    sources.mkdir()
    model_variables = variables(model.parameters)
    kernel = kernel_source(model, model_variables, fixture=mounted.fixture, cooling=mounted.cooling)
    (sources / "kernel.c").write_text(kernel)
    for name in ("plant.c", SOURCE[version]):
        shutil.copyfile(_WRITTEN / name, sources / name)
    token = "{" + hashlib.sha256(kernel.encode()).hexdigest()[:32] + "}"
    (sources / "token.h").write_text(f'#define TOKEN "{token}"\n')
    (folder / "modelDescription.xml").write_bytes(description(version, model_variables, token))
    if version == 3:
        (sources / "buildDescription.xml").write_bytes(build_description())


def compile_unit(folder: Path, version: int) -> str:
    """Compile the sources of a unit for this machine; return its platform, "" without a compiler.

    Raises FmiError for a compiler that fails.
    """
    compiler = shutil.which(os.environ.get("CC", "cc"))
    built_for = _FOLDERS[version].get(f"{platform.system()}-{platform.machine()}", "")
    if compiler is None or not built_for:
        return ""
    binary = folder / "binaries" / built_for / f"{IDENTIFIER}.so"
    binary.parent.mkdir(parents=True)
    source = folder / "sources" / SOURCE[version]
    done = subprocess.run(
        [compiler, *_FLAGS, str(source), "-o", str(binary), "-lm"],
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        first = next((line for line in done.stderr.splitlines() if "error" in line), "no message")
        raise FmiError(f"{compiler} does not compile the unit: {first}", action="set CC to another")
    return built_for


def _pack(folder: Path, target: Path) -> None:
    with (
        named_output(target, FmiError, action="check folder and space") as partial,
        zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                archive.write(path, path.relative_to(folder))
