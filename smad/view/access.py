"""Who is let in: three secrets for three places, and only pages that this server gave out.

Pure. The token of a link gives the page with a cookie and a key. The cookie gives files and
nothing else: a browser shows it to every server on this host, whatever its port. The key stands
in the page alone and gives the right on its WebSocket. The secrets keep out other users of the
machine; the checks of `Host` and `Origin` keep out other pages in the same browser, which can send
requests here but choose neither header.
"""

import hmac
import secrets
from collections.abc import Mapping
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import Literal, NamedTuple
from urllib.parse import parse_qs, urlsplit

Right = Literal["command", "watch"]

PROTOCOL = "smad"
"""The subprotocol of the page's WebSocket. The page offers `key.` and its key beside it."""

HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; "
    "img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
"""Sent with every answer: nothing from elsewhere runs in the page, and nobody frames it."""

REPORT_HEADERS = {
    **HEADERS,
    "Content-Security-Policy": "default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; sandbox allow-scripts allow-downloads",
}
"""Of a page that a job wrote. It brings its scripts along, so it is nobody's origin: it has neither
key nor storage of the live page, and sends nothing anywhere."""


class Denied(NamedTuple):
    """Why a request gets nothing."""

    status: HTTPStatus
    text: str


class Admitted(NamedTuple):
    """What a request may do: open a WebSocket with `right`, or else read files.

    Who came with the token of a link gets the page with `cookie` to be set and `key` put into it.
    """

    right: Right | None = None
    cookie: str = ""
    key: str = ""


class AccessControl:
    """The secrets of one server and the addresses it answers to.

    `command` and `watch` are the tokens of the links. `command` is empty where nobody may command
    (`smad view --watch-only`).
    """

    def __init__(self, port: int, *, watch_only: bool = False) -> None:
        self.watch = secrets.token_urlsafe(32)
        self.command = "" if watch_only else secrets.token_urlsafe(32)
        self.keys: Mapping[Right, str] = {
            "command": "" if watch_only else secrets.token_urlsafe(32),
            "watch": secrets.token_urlsafe(32),
        }
        self.cookie = secrets.token_urlsafe(32)
        # Cookies know no ports: two servers on one machine must not share a name.
        self.cookie_name = f"smad_view_{port}"
        self._hosts = frozenset(
            (f"127.0.0.1:{port}", f"localhost:{port}") + (("127.0.0.1",) if port == 80 else ())
        )

    def admit(
        self, target: str, headers: Mapping[str, str], *, websocket: bool
    ) -> Admitted | Denied:
        """Judge a request by its target (path and query) and its headers (names in lower case)."""
        if headers.get("host", "").lower() not in self._hosts:
            return Denied(HTTPStatus.FORBIDDEN, "This address is not the one of the page.")
        origin = headers.get("origin", "")
        if (origin or websocket) and not self._is_ours(origin):
            return Denied(HTTPStatus.FORBIDDEN, "This request comes from another page.")
        has_cookie = _same(_cookie_of(headers.get("cookie", ""), self.cookie_name), self.cookie)
        # No link is made of the token for the connection: a page has cookie and key.
        token = None if websocket else _token_of(target)
        if websocket:
            key = _key_of(headers.get("sec-websocket-protocol", ""))
            right = _right(key, self.keys["command"], self.keys["watch"])
            if has_cookie and right is not None:
                return Admitted(right)
        elif token is not None:
            right = _right(token, self.command, self.watch)
            if right is not None:
                cookie = f"{self.cookie_name}={self.cookie}; HttpOnly; SameSite=Strict; Path=/"
                return Admitted(None, cookie, self.keys[right])
        elif has_cookie:
            return Admitted()
        return Denied(
            HTTPStatus.UNAUTHORIZED,
            "Open the link that `smad view` printed when it was last started: older ones expired.",
        )

    def _is_ours(self, origin: str) -> bool:
        scheme, _, host = origin.partition("://")
        return scheme == "http" and host.lower() in self._hosts


def _right(token: str, command: str, watch: str) -> Right | None:
    # Both are compared, whatever the first says: the time taken tells nothing.
    commands, watches = _same(token, command), _same(token, watch)
    return "command" if commands else "watch" if watches else None


def _same(candidate: str, secret: str) -> bool:
    # An empty secret is one that nobody has.
    offered = candidate.encode("utf-8", "surrogateescape")
    return bool(secret) & hmac.compare_digest(offered, secret.encode())


def _token_of(target: str) -> str | None:
    tokens = parse_qs(urlsplit(target).query, keep_blank_values=True).get("token")
    return None if tokens is None else tokens[0]


def _key_of(offered: str) -> str:
    names = (name.strip() for name in offered.split(","))
    return next((name[4:] for name in names if name.startswith("key.")), "")


def _cookie_of(header: str, name: str) -> str:
    try:
        cookie = SimpleCookie(header).get(name)
    except CookieError:
        return ""
    return "" if cookie is None else cookie.value
