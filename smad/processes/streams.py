"""The standard streams of a program, made such that nothing that is printed ends it."""

import io
import os
import sys


def prepare_streams() -> None:
    """Let a standard stream that was closed go nowhere, and print letters that stdout lacks.

    A file that is opened would get the number of a closed one, and with it what libraries print.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
