"""The server of the pages, over real connections on this machine and with no bench behind it."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from typing import Any
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Origin, Subprotocol

from bench.browser import credentials_of
from smad.client.endpoints import FOLDER_VARIABLE
from smad.view import page as pages
from smad.view import server
from smad.view.server import KEPT_FOR_COMMAND, MOST_PAGES, LivePage, serving


@pytest.fixture
async def served(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[LivePage]:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    # A busy machine may let pages wait for longer than a page that hangs is given.
    monkeypatch.setattr(pages, "PATIENCE_S", 600.0)
    async with serving("nobody", 0) as made:
        yield made


async def opened(link: str, *, with_key: bool = True, **more: Any) -> ClientConnection:
    cookie, key = await asyncio.to_thread(credentials_of, link)
    return await knock(link, cookie, key if with_key else "", **more)


async def knock(link: str, cookie: str, key: str, **more: Any) -> ClientConnection:
    address = f"127.0.0.1:{urlsplit(link).port}"
    offered = [Subprotocol("smad")] + ([Subprotocol(f"key.{key}")] if key else [])
    return await connect(
        f"ws://{address}/ws",
        origin=Origin(f"http://{address}"),
        additional_headers={"Cookie": cookie},
        subprotocols=offered,
        open_timeout=120.0,
        **more,
    )


async def first_message(connection: ClientConnection) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(await connection.recv())
    return found


async def test_cookie_and_key_of_a_link_give_its_right(served: LivePage) -> None:
    for link, right in ((served.links.command, "command"), (served.links.watch, "watch")):
        connection = await opened(link)
        assert connection.subprotocol == "smad"
        assert (await first_message(connection))["right"] == right
        await connection.close()


async def test_with_the_cookie_alone_no_page_begins_so_nothing_is_commanded_or_armed(
    served: LivePage, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun: list[object] = []
    monkeypatch.setattr(pages.Page, "__init__", lambda *rest: begun.append(rest))
    with pytest.raises(InvalidStatus) as refused:
        await opened(served.links.command, with_key=False)
    assert refused.value.response.status_code == 401
    assert begun == []


async def fill(link: str) -> list[ClientConnection]:
    """Open pages until there is no place for another."""
    found: list[ClientConnection] = []
    with contextlib.suppress(ConnectionClosed):
        while len(found) <= MOST_PAGES:
            connection = await opened(link)
            await first_message(connection)
            found.append(connection)
    # What the page shows: a refused handshake would give it no reason.
    assert "no room for more: close one" in str(connection.close_reason)
    return found


async def test_pages_that_watch_leave_places_for_those_that_command(served: LivePage) -> None:
    watching = await fill(served.links.watch)
    assert len(watching) == MOST_PAGES - KEPT_FOR_COMMAND
    commanding = await fill(served.links.command)
    assert len(commanding) == KEPT_FOR_COMMAND


async def test_no_more_pages_begin_when_many_knock_at_once(served: LivePage) -> None:
    link = served.links.watch
    cookie, key = await asyncio.to_thread(credentials_of, link)
    knocked = await asyncio.gather(
        *(knock(link, cookie, key) for _ in range(2 * MOST_PAGES)), return_exceptions=True
    )
    begun = 0
    for connection in knocked:
        if isinstance(connection, ClientConnection):
            with contextlib.suppress(ConnectionClosed):
                await first_message(connection)
                begun += 1
    assert begun == MOST_PAGES - KEPT_FOR_COMMAND


async def test_a_page_that_is_asleep_or_hangs_loses_its_place(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    monkeypatch.setattr(server, "MOST_PAGES", KEPT_FOR_COMMAND + 1)
    monkeypatch.setattr(pages, "PATIENCE_S", 0.05)
    monkeypatch.setattr(pages, "LOOK_EVERY_S", 0.05)
    async with serving("nobody", 0) as made:
        for asleep in (True, False):
            first = await opened(made.links.watch)
            await first_message(first)
            if asleep:
                # As a computer that fell asleep: what comes is read by nobody. Else the
                # connection answers pings, as that of a page whose script hangs.
                first.transport.pause_reading()
            async with asyncio.timeout(30.0):
                while True:
                    next_one = await opened(made.links.watch)
                    with contextlib.suppress(ConnectionClosed):
                        await first_message(next_one)
                        break
            first.transport.abort()
            await next_one.close()
