"""The page's web server: static files, and one WebSocket for each open page. Loopback only."""

import asyncio
import contextlib
import logging
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from http import HTTPStatus
from typing import NamedTuple
from urllib.parse import urlsplit

from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.frames import CloseCode
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from smad.bridge.loopback import HOST, listen, quiet
from smad.client import AsyncClient
from smad.client.following import TIMEOUT_S
from smad.view.access import HEADERS, PROTOCOL, REPORT_HEADERS, AccessControl, Denied, Right
from smad.view.page import Page, static_files
from smad.view.queries import Queries
from smad.view.source import Source
from smad.view.tasks import cancel_and_wait

MOST_PAGES = 16
KEPT_FOR_COMMAND = 4
"""Pages of the watching link leave so many of these places free."""
LARGEST_MESSAGE = 16_384
"""Bytes that a page may send at once; a form is a few hundred."""
CLOSING_S = 1.0
"""How long the server waits at its end for a page to say goodbye; one that is asleep never does."""
_WEBSOCKET = "/ws"
_HTML = "text/html; charset=utf-8"
_KEY_PLACE = b"{key}"
"""Where `index.html` has the key; empty for who has but the cookie."""
_log = logging.getLogger(__name__)


class Links(NamedTuple):
    """What to open in a browser; `command` is empty where nobody may command."""

    command: str
    watch: str


class LivePage:
    """Serves the live page of a bench. `links` holds the secrets."""

    def __init__(self, bench: str, access: AccessControl, port: int) -> None:
        self.source = Source(bench)
        self.queries = Queries(self.source)
        self._bench = bench
        self._access = access
        self._open: Counter[Right] = Counter()
        self._files = static_files()
        address = f"http://{HOST}:{port}/?token="
        self.links = Links(access.command and address + access.command, address + access.watch)

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer a request for a file, or let it become a WebSocket (None)."""
        path = urlsplit(request.path).path
        judged = self._access.admit(
            request.path, _headers(request.headers), websocket=path == _WEBSOCKET
        )
        if isinstance(judged, Denied):
            return _response(judged.status, f"{judged.text}\n".encode())
        if judged.cookie:
            # The key is in this answer alone: who has but the cookie cannot ask for it.
            kind, content = self._files["/"]
            content = content.replace(_KEY_PLACE, judged.key.encode())
            return _response(HTTPStatus.OK, content, Content_Type=kind, Set_Cookie=judged.cookie)
        if path == _WEBSOCKET:
            return None
        report = self.queries.jobs.report(path)
        if report is not None:
            return _response(HTTPStatus.OK, report, REPORT_HEADERS, Content_Type=_HTML)
        if path not in self._files:
            return _response(HTTPStatus.NOT_FOUND, b"There is no such page.\n")
        kind, content = self._files[path]
        if path == "/":
            content = content.replace(_KEY_PLACE, b"")
        return _response(HTTPStatus.OK, content, Content_Type=kind)

    async def talk(self, connection: ServerConnection) -> None:
        """Serve one page over its WebSocket."""
        request = connection.request
        assert request is not None
        judged = self._access.admit(request.path, _headers(request.headers), websocket=True)
        if isinstance(judged, Denied) or judged.right is None:
            return
        if full := self._full(judged.right):
            # A browser keeps the reason of a refused handshake from its page, and tells that of
            # an end.
            await connection.close(CloseCode.TRY_AGAIN_LATER, full)
            return
        self._open[judged.right] += 1
        try:
            await Page(
                connection,
                judged.right,
                self.source,
                lambda: AsyncClient(self._bench, timeout_s=TIMEOUT_S, lease_s=None),
                self.queries,
            ).run()
        except Exception:
            _log.exception("a page was closed by an error of the server")
            raise
        finally:
            self._open[judged.right] -= 1

    def _full(self, right: Right) -> str:
        most = MOST_PAGES - (KEPT_FOR_COMMAND if right == "watch" else 0)
        if self._open.total() < most:
            return ""
        return f"{most} pages are open, and there is no room for more: close one of them."


@contextlib.asynccontextmanager
async def serving(bench: str, port: int, *, watch_only: bool = False) -> AsyncIterator[LivePage]:
    """Serve the page as long as the block lasts. Port 0: any free one. Raises ConfigError."""
    listening = listen(port)
    bound = listening.getsockname()[1]
    page = LivePage(bench, AccessControl(bound, watch_only=watch_only), bound)
    async with serve(
        page.talk,
        sock=listening,
        process_request=page.answer,
        subprotocols=[Subprotocol(PROTOCOL)],
        compression=None,
        max_size=LARGEST_MESSAGE,
        max_queue=8,
        # Pages are missed by what their own scripts do not answer.
        ping_interval=None,
        close_timeout=CLOSING_S,
        server_header=None,
        logger=quiet("smad.view.strangers"),
    ):
        following = asyncio.create_task(page.source.run())
        try:
            yield page
        finally:
            await cancel_and_wait(following)
            await page.queries.close()
            if not following.cancelled():
                following.result()


def _headers(headers: Headers) -> dict[str, str]:
    # A header that comes twice is joined, and so is no host or origin of ours.
    return {name.lower(): ", ".join(headers.get_all(name)) for name in headers}


def _response(
    status: HTTPStatus, body: bytes, common: Mapping[str, str] = HEADERS, **extra: str
) -> Response:
    headers = Headers(
        {
            **common,
            "Content-Type": "text/plain; charset=utf-8",
            "Content-Length": str(len(body)),
            "Connection": "close",
            **{name.replace("_", "-"): value for name, value in extra.items()},
        }
    )
    return Response(int(status), status.phrase, headers, body)
