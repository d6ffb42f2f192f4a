"""The parts of smad that are installed by an extra, and what to say where one is missing."""

import importlib
from collections.abc import Mapping, Sequence
from typing import Any

from smad.errors import MissingPartError

EXTRA_OF: Mapping[str, str] = {
    "fmpy": "fmi",
    "gymnasium": "env",
    "jinja2": "log",
    "matplotlib": "report",
    "mujoco": "mujoco",
    "numba": "sim",
    "numpy": "log",
    "pandas": "notebook",
    "pyarrow": "export",
    "pythonfmu": "fmi",
    "rosbags": "ros",
    "scipy": "export",
    "threadpoolctl": "gap",
}
"""Package -> the smallest extra that brings it."""
_LOG = ("jinja2", "numpy")
_SIM = (*_LOG, "numba", "scipy")
_REPORT = (*_SIM, "matplotlib")
BROUGHT_BY: Mapping[str, Sequence[str]] = {
    "log": _LOG,
    "sim": _SIM,
    "report": _REPORT,
    "gap": (*_REPORT, "threadpoolctl"),
}
"""Extra -> every package that it brings, for the extras of commands that heat a bench."""
EXTRA_OF_COMMAND: Mapping[str, str] = {
    "demo": "sim",
    "design": "sim",
    "faults": "sim",
    "gap": "gap",
    "health": "sim",
    "log export": "export",
    "log import": "export",
    "run": "report",
    "sim": "sim",
    "start": "sim",
    "tune": "sim",
}
"""Command -> the extra that brings all it needs, where that is more than its first package."""


def part(name: str) -> Any:
    """Import and return a package of an extra. Raises MissingPartError, naming the extra."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        missing_part = missing(error)
        raise missing_part if missing_part is not None else error from None


def missing(
    error: ModuleNotFoundError, arguments: Sequence[str] = (), *, extra: str = ""
) -> MissingPartError | None:
    """Return what to say of an import that failed; None when it is not for want of an extra.

    `arguments` are those of the command that needed it, if it was one; `extra` is the one to
    advise where that is known.
    """
    package = (error.name or "").partition(".")[0]
    smallest = EXTRA_OF.get(package)
    if smallest is None:
        return None
    command = next(
        (name for name in (" ".join(arguments[:2]), *arguments[:1]) if name in EXTRA_OF_COMMAND), ""
    )
    return MissingPartError(
        f"{package} is not installed, which {f'smad {command}' if command else 'this'} needs",
        action="in the folder that smad was installed from: "
        f"pip install '.[{extra or EXTRA_OF_COMMAND.get(command, smallest)}]'",
    )
