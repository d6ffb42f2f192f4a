"""Dates and times of day in a table, as seconds since the first."""

import contextlib
from datetime import UTC, datetime

FORMATS = (
    "%d.%m.%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %H:%M:%S", "%d/%m/%Y %H:%M:%S",
    "%Y/%m/%d %H:%M:%S", "%d-%b-%Y %H:%M:%S", "%H:%M:%S", "%d.%m.%Y %H:%M", "%m/%d/%Y %H:%M",
)  # fmt: skip
"""How stamps are written that have to be declared; each with fractions, too."""


def read_stamp(text: str, form: str = "") -> datetime:
    """The time of a stamp of ISO 8601, or of a form of strptime; UTC where it has no zone.

    Raises ValueError for another text, and for one without a time of day.
    """
    if ":" not in text:
        raise ValueError(text)
    read = datetime.strptime(text, form) if form else datetime.fromisoformat(text)
    return read if read.tzinfo else read.replace(tzinfo=UTC)


def is_stamp(text: str, form: str = "") -> bool:
    """Whether a text is one."""
    with contextlib.suppress(ValueError):
        return bool(read_stamp(text, form))
    return False


def likely_forms(text: str) -> list[str]:
    """The forms that a text may be written in, best said by whoever knows."""
    forms = [form.replace("%S", f"%S{tail}") for form in FORMATS for tail in ("", ".%f", ",%f")]
    return [form for form in dict.fromkeys(forms) if is_stamp(text, form)]
