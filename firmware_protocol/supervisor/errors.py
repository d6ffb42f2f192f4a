"""What can go wrong in this package when it is called wrongly."""

from __future__ import annotations


class SupervisorError(Exception):
    """Base of the errors of the supervisor."""


class LimitError(SupervisorError):
    """A limit that does not exist, or a stored value outside its soft range."""


class TranslationError(SupervisorError):
    """The core uses Python that has no counterpart in the generated C."""


class DocumentError(SupervisorError):
    """The markers of docs/safety.md and the generated parts do not fit together."""
