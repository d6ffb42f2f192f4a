"""JSON-RPC 2.0 without sockets: bytes in, a typed call or an error reply out. Pure.

Any bytes give a call, a reply, or nothing where none is due; never an exception.
"""

import functools
import json
import re
from types import NoneType
from typing import Any, Literal

import msgspec
from msgspec import UNSET, Struct, UnsetType

from smad.api import (
    BY_PARAMS,
    ERROR_CODES,
    LARGEST_MESSAGE,
    METHODS,
    REFUSED,
    Access,
    ErrorData,
    Method,
    Reason,
)
from smad.config.bounds import in_words, value_at
from smad.daemon.errors import Refusal
from smad.errors import SmadError

Id = int | str | None
Axes = str | tuple[str, ...] | None
"""Whom a request is for: the name of an axis, several, or nobody in particular."""


@functools.cache
def _request_type(method: Method) -> type[Struct]:
    required = any(field.required for field in msgspec.structs.fields(method.params))
    return msgspec.defstruct(
        f"{method.params.__name__}Request",
        [
            ("params", method.params) if required else ("params", method.params, method.params()),
            ("id", int | str | None | UnsetType, UNSET),
            # A stop is not refused because of what it does not need.
            ("lease", Any if method.access == "stop" else str, ""),
            ("generation", Any if method.access == "stop" else int | None, None),
            ("axis", Any if method.access == "stop" else Axes, None),
            ("jsonrpc", Literal["2.0"], "2.0"),
        ],
        tag_field="method",
        tag=method.name,
        frozen=True,
        forbid_unknown_fields=True,
        kw_only=True,
    )


def request_union(*access: Access) -> Any:
    """Return the tagged union of the requests of the methods with that access; all by default."""
    chosen = [m for m in METHODS if not access or m.access in access]
    union: Any = _request_type(chosen[0])
    for method in chosen[1:]:
        union = union | _request_type(method)
    return union


class Call(Struct, frozen=True):
    """A valid request: what is asked, with which parameters, and the id of the reply.

    `wants_reply` is false for a notification. `lease` is the secret of the caller's exclusive
    control, `generation` that of the last stop it knows of, `axes` are those that it names: all
    may be left out.
    """

    method: Method
    params: Struct
    id: Id
    wants_reply: bool
    lease: str = ""
    generation: int | None = None
    axes: tuple[str, ...] = ()


class _Request(Struct, frozen=True):
    # What every member of the union has; the union's own types are made at run time.
    params: Struct
    id: Id | UnsetType
    lease: Any
    generation: Any
    axis: Any


class _Names:
    """Finds names that an object gives twice: msgspec takes the last one without a word."""

    def __init__(self) -> None:
        self._twice: list[str] = []
        self._decoder = json.JSONDecoder(object_pairs_hook=self._object)

    def twice(self, data: bytes) -> list[str]:
        """Return them. Raises ValueError or RecursionError for what Python cannot read."""
        self._twice = []
        self._decoder.decode(_NUMBERS.sub(b"[]", data).decode())
        return self._twice

    def _object(self, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        members = dict(pairs)
        if len(members) < len(pairs):
            names = [name for name, _ in pairs]
            self._twice += [name for name in members if names.count(name) > 1]
        return members


_NUMBERS = re.compile(rb"\[[-+.0-9eE,\s]+\]")
"""Lists of numbers hold no names, and to read them would take most of the time."""

_NO_PARAMETERS = re.compile(rb'"params"\s*:\s*\[\s*\]')
"""How some libraries say that there are none: a stop must not fail for its form."""

_REPLY = msgspec.json.Encoder()
_MEMBERS = msgspec.json.Decoder(dict[str, msgspec.Raw])
_ID = msgspec.json.Decoder(int | str | None)
_STOP_METHODS = ", ".join(m.name for m in METHODS if m.access == "stop")


class Decoder:
    """Decodes requests for methods of the given access; all methods by default."""

    def __init__(self, *access: Access) -> None:
        self._decoder: msgspec.json.Decoder[_Request] = msgspec.json.Decoder(request_union(*access))
        self._allowed = {m.name for m in METHODS if not access or m.access in access}
        self._names = _Names()

    def decode(self, data: bytes) -> Call | bytes | None:
        """Return the call, or the error reply that `data` deserves.

        A notification that is refused gets no reply: None.
        """
        if len(data) > LARGEST_MESSAGE:
            return error_reply(None, _too_long(len(data)))
        try:
            request = self._decoder.decode(data)
            twice = self._names.twice(data)
        except msgspec.ValidationError as error:
            named = _NO_PARAMETERS.sub(b'"params":{}', data)
            return self._refuse(data, str(error)) if named == data else self.decode(named)
        except (msgspec.DecodeError, RecursionError, ValueError) as error:
            return error_reply(None, _malformed(error))
        call_id = None if request.id is UNSET else request.id
        if twice:
            return error_reply(None if "id" in twice else call_id, _given_twice(twice))
        method = BY_PARAMS[type(request.params)]
        return Call(
            method,
            request.params,
            call_id,
            request.id is not UNSET,
            request.lease if isinstance(request.lease, str) else "",
            request.generation if isinstance(request.generation, int) else None,
            _axes(request.axis),
        )

    def _refuse(self, data: bytes, message: str) -> bytes | None:
        try:
            members = _MEMBERS.decode(data)
            twice = self._names.twice(data)
        except msgspec.ValidationError:
            return error_reply(None, _no_request(message))
        except (msgspec.DecodeError, RecursionError, ValueError) as error:
            return error_reply(None, _malformed(error))
        try:
            call_id = _ID.decode(members.get("id", b"null"))
        except msgspec.ValidationError:
            return error_reply(None, _no_request("`id` is not a whole number, text or null"))
        if twice:
            return error_reply(None if "id" in twice else call_id, _given_twice(twice))
        name = _text(members.get("method"))
        wrong = _misshapen(members, name)
        if wrong:
            return error_reply(call_id, _no_request(wrong))
        if "id" not in members:
            return None
        if name not in self._allowed:
            return error_reply(call_id, _unknown(name))
        return error_reply(call_id, _bad_params(name, data, message))


def _axes(named: Any) -> tuple[str, ...]:
    if isinstance(named, str):
        return (named,)
    return named if isinstance(named, tuple) else ()


def _text(member: msgspec.Raw | None) -> str:
    """Return the text that a member is, or nothing."""
    value = None if member is None else _plain_value(member)
    return value if isinstance(value, str) else ""


def _plain_value(member: msgspec.Raw) -> Any:
    try:
        return msgspec.json.decode(member)
    except msgspec.MsgspecError:
        # A number too large for any type.
        return None


_MEMBERS_KNOWN = {"jsonrpc", "id", "method", "params", "lease", "generation", "axis"}
_BESIDE = (
    ("lease", (str, NoneType), "no text"),
    ("generation", (int, NoneType), "no whole number"),
    ("axis", (str, list, NoneType), "no text or list"),
)


def _misshapen(members: dict[str, msgspec.Raw], method: str) -> str:
    """Say what makes this no JSON-RPC request at all; nothing when it is one."""
    if not method:
        return "`method` is missing, or no text"
    # A stop is not refused because its version was left out.
    if _text(members.get("jsonrpc", msgspec.Raw(b'"2.0"'))) != "2.0":
        return '`jsonrpc` is not "2.0"'
    if bytes(members.get("params", b"{"))[:1] not in (b"{", b"["):
        return "`params` is not an object"
    for beside, kinds, fault in _BESIDE:
        if not isinstance(_plain_value(members.get(beside, msgspec.Raw(b"null"))), kinds):
            return f"`{beside}` is {fault}"
    strange = members.keys() - _MEMBERS_KNOWN
    if strange:
        return f"it has an unknown member `{min(strange)}`"
    return ""


def _malformed(error: Exception) -> Refusal:
    return Refusal(
        Reason.MALFORMED,
        f"this is not JSON: {error}",
        action="send one JSON-RPC 2.0 object a message",
    )


def _too_long(size: int) -> Refusal:
    return Refusal(
        Reason.NO_REQUEST,
        "the message is too long",
        value=f"{size} bytes",
        limit=f"{LARGEST_MESSAGE} bytes",
        action="nothing was changed; send it in pieces",
    )


def _no_request(message: str) -> Refusal:
    return Refusal(
        Reason.NO_REQUEST,
        f"this is not a request: {message}",
        action="send one JSON-RPC 2.0 object with a method, not a batch",
    )


def _given_twice(names: list[str]) -> Refusal:
    return Refusal(
        Reason.NO_REQUEST,
        "a name is given twice in one object",
        value=names[0],
        limit="each name once",
        action="nothing was changed; leave one of the two out",
    )


def _bad_params(name: str, data: bytes, message: str) -> Refusal:
    cause, _, path = message.partition(" - at `$.params")
    field = path.rstrip("`").lstrip(".")
    return Refusal(
        Reason.INVALID,
        f"{name}: {field or 'the request'} is not valid: {in_words(cause)}",
        value=_value_at(data, path.rstrip("`")),
        action="nothing was changed; smad docs guide/clients lists the fields",
    )


def _unknown(name: str) -> Refusal:
    if any(method.name == name for method in METHODS):
        return Refusal(
            Reason.UNKNOWN_METHOD,
            "this channel takes stop commands only",
            value=name,
            limit=_STOP_METHODS,
            action="send it to the command socket",
        )
    return Refusal(
        Reason.UNKNOWN_METHOD,
        "there is no such method",
        value=name,
        action="smad docs guide/clients lists them all",
    )


def _value_at(data: bytes, path: str) -> Any:
    try:
        value = msgspec.json.decode(data).get("params")
    except (msgspec.MsgspecError, RecursionError, ValueError):
        # A number too large for any type spoils the whole message.
        return None
    value = value_at(value, path)
    return value if isinstance(value, int | float | str | bool) else None


def result_reply(call_id: Id, result: Struct) -> bytes:
    """Return the reply to a call that was carried out."""
    return _REPLY.encode({"jsonrpc": "2.0", "id": call_id, "result": result})


def error_reply(call_id: Id, error: SmadError) -> bytes:
    """Return the reply to a call that was refused. Values that JSON cannot carry become text."""
    reason = error.reason if isinstance(error, Refusal) else Reason.INVALID
    data = ErrorData(
        reason=reason,
        cause=error.cause,
        value=_plain(error.value),
        limit=_plain(error.limit),
        action=error.action,
    )
    return _REPLY.encode(
        {
            "jsonrpc": "2.0",
            "id": call_id,
            "error": {
                "code": ERROR_CODES.get(reason, REFUSED),
                "message": str(error),
                "data": data,
            },
        }
    )


def _plain(value: Any) -> Any:
    return value if isinstance(value, int | float | str | bool | None) else str(value)
