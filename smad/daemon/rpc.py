"""JSON-RPC 2.0 without sockets: bytes in, a typed call or an error reply out. Pure.

Any bytes give a call or a reply, never an exception.
"""

from __future__ import annotations

from typing import Any, Literal

import msgspec
from msgspec import Struct

from smad.api import (
    BY_PARAMS,
    ERROR_CODES,
    METHODS,
    REFUSED,
    Access,
    ErrorData,
    Method,
    Reason,
)
from smad.daemon.errors import Refusal
from smad.errors import SmadError

Id = int | str | None


def _request_type(method: Method) -> type[Struct]:
    required = any(field.required for field in msgspec.structs.fields(method.params))
    return msgspec.defstruct(
        f"{method.params.__name__}Request",
        [
            ("params", method.params) if required else ("params", method.params, method.params()),
            ("id", int | str | None, None),
            ("lease", str, ""),
            ("generation", int | None, None),
            ("jsonrpc", Literal["2.0"], "2.0"),
        ],
        tag_field="method",
        tag=method.name,
        frozen=True,
        forbid_unknown_fields=True,
        kw_only=True,
    )


def _request_union(*access: Access) -> Any:
    """Return the tagged union of the requests of the methods with that access; all by default."""
    chosen = [m for m in METHODS if not access or m.access in access]
    union: Any = _request_type(chosen[0])
    for method in chosen[1:]:
        union = union | _request_type(method)
    return union


class Call(Struct, frozen=True):
    """A valid request: what is asked, with which parameters, and the id of the reply.

    `wants_reply` is false for a notification. `lease` is the secret of the caller's exclusive
    control, `generation` that of the last stop it knows of: both may be left out.
    """

    method: Method
    params: Struct
    id: Id
    wants_reply: bool
    lease: str = ""
    generation: int | None = None


class _Request(Struct, frozen=True):
    # What every member of the union has; the union's own types are made at run time.
    params: Struct
    id: Id
    lease: str
    generation: int | None


class _Loose(Struct, frozen=True):
    """What can be had from a request that is not valid."""

    id: Any = None
    method: Any = None


_REPLY = msgspec.json.Encoder()
_LOOSE = msgspec.json.Decoder(_Loose)
_STOP_METHODS = ", ".join(m.name for m in METHODS if m.access == "stop")


class Decoder:
    """Decodes requests for methods of the given access; all methods by default."""

    def __init__(self, *access: Access) -> None:
        self._decoder: msgspec.json.Decoder[_Request] = msgspec.json.Decoder(
            _request_union(*access)
        )
        self._known = {m.name for m in METHODS if not access or m.access in access}

    def decode(self, data: bytes) -> Call | bytes:
        """Return the call, or the error reply that `data` deserves."""
        try:
            request = self._decoder.decode(data)
        except msgspec.ValidationError as error:
            return self._refuse(data, str(error))
        except (msgspec.DecodeError, RecursionError, ValueError) as error:
            return error_reply(
                None,
                Refusal(
                    Reason.MALFORMED,
                    f"this is not JSON: {error}",
                    action="send one JSON-RPC 2.0 object a message",
                ),
            )
        method = BY_PARAMS[type(request.params)]
        return Call(
            method,
            request.params,
            request.id,
            request.id is not None,
            request.lease,
            request.generation,
        )

    def _refuse(self, data: bytes, message: str) -> bytes:
        call_id: Id = None
        name: Any = None
        try:
            loose = _LOOSE.decode(data)
        except (msgspec.MsgspecError, RecursionError, ValueError):
            pass
        else:
            name = loose.method
            call_id = loose.id if isinstance(loose.id, int | str) else None
        if not isinstance(name, str):
            return error_reply(
                call_id,
                Refusal(
                    Reason.INVALID,
                    f"this is not a request: {message}",
                    action="send one JSON-RPC 2.0 object with a method, not a batch",
                ),
            )
        if name not in self._known:
            return error_reply(call_id, _unknown(name))
        cause, _, path = message.partition(" - at `$.params")
        field = path.rstrip("`").lstrip(".")
        return error_reply(
            call_id,
            Refusal(
                Reason.INVALID,
                f"{name}: {field or 'the request'} is not valid: {cause}",
                value=_value_at(data, path.rstrip("`")),
                action="nothing was changed; docs/guide/clients.md lists the fields",
            ),
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
        action="docs/guide/clients.md lists them all",
    )


def _value_at(data: bytes, path: str) -> Any:
    try:
        value = msgspec.json.decode(data).get("params")
    except (msgspec.MsgspecError, RecursionError, ValueError):
        # A number too large for any type spoils the whole message.
        return None
    for part in path.replace("[", ".").replace("]", "").split("."):
        if not part:
            continue
        try:
            value = value[int(part)] if isinstance(value, list) else value[part]
        except (KeyError, IndexError, TypeError, ValueError):
            return None
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
