"""Libraries of generated C: compiled where a compiler is, known by the text they are made from."""

from __future__ import annotations

import ctypes
import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

_L = TypeVar("_L", bound=ctypes.CDLL)

FLAGS = ("-std=c11", "-shared", "-fPIC")
_DIGEST = "smad_digest"


def digest_of(files: Iterable[Path]) -> str:
    """A name for the text of some files."""
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


def compile_library(
    target: Path, files: Mapping[str, str], digest: str, flags: Sequence[str]
) -> bool:
    """Compile C `files`, name and content, to the library `target`, to be known by `digest`.

    Returns whether a C compiler is here (`cc`, or what CC says). Whoever has an earlier library of
    that path loaded keeps it. Raises subprocess.CalledProcessError for a compiler that fails, and
    OSError where `target` cannot be written.
    """
    # Whoever only opens a library needs none of these, and would wait for them at start-up.
    import shlex
    import shutil
    import subprocess
    import tempfile

    command = shlex.split(os.environ.get("CC", "cc"))
    if not command or shutil.which(command[0]) is None:
        return False
    known_by = f'const char *const {_DIGEST} = "{digest}";\n'
    with tempfile.TemporaryDirectory(dir=target.parent, prefix=f".{target.stem}-") as name:
        folder = Path(name)
        for file, content in {**files, "digest.c": known_by}.items():
            (folder / file).write_text(content)
        made = folder / target.name
        sources = sorted(map(str, folder.glob("*.c")))
        subprocess.run([*command, *FLAGS, *flags, *sources, "-o", str(made), "-lm"], check=True)
        made.replace(target)
    return True


def open_library(path: Path, digest: str, kind: type[_L]) -> _L:
    """The library at `path`, as one of a `kind`. Raises OSError for one of another digest."""
    library = kind(str(path))
    try:
        built_of = ctypes.c_char_p.in_dll(library, _DIGEST).value
    except ValueError:
        built_of = None
    if built_of != digest.encode():
        raise OSError(f"{path} was built of another text")
    return library
