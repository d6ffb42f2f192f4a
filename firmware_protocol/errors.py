"""Every exception of the package. Sessions raise none for bytes they receive: those are counted."""

from __future__ import annotations


class ProtocolError(Exception):
    """Base of all errors of this package."""


class PayloadError(ProtocolError):
    """A payload does not fit its message, or a message does not fit the wire."""


class SchemaError(ProtocolError):
    """A schema description cannot be read, or the message table contradicts itself."""


class NotConnectedError(ProtocolError):
    """The host session has no board to talk to."""


class NotARequestError(ProtocolError):
    """The message given is none that the other end answers."""


class ParameterError(ProtocolError):
    """A parameter cannot take the value given."""


class RateError(ProtocolError):
    """The baud rate cannot carry the STATE rate asked for."""


class QueueFullError(ProtocolError):
    """Too many requests are waiting for their turn."""


class NotAllowedError(ProtocolError):
    """The board has another table of messages: it may be watched, not commanded."""
