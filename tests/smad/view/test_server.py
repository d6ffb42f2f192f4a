"""The server of the pages, over real connections on this machine and with no bench behind it."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin, Subprotocol

from bench.browser import credentials_of
from smad.client.endpoints import FOLDER_VARIABLE
from smad.view import page as pages
from smad.view.server import LivePage, serving


@pytest.fixture
async def served(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[LivePage]:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    async with serving("nobody", 0) as made:
        yield made


async def opened(link: str, *, with_key: bool = True, **more: Any) -> ClientConnection:
    cookie, key = await asyncio.to_thread(credentials_of, link)
    address = f"127.0.0.1:{urlsplit(link).port}"
    offered = [Subprotocol("smad")] + ([Subprotocol(f"key.{key}")] if with_key else [])
    return await connect(
        f"ws://{address}/ws",
        origin=Origin(f"http://{address}"),
        additional_headers={"Cookie": cookie},
        subprotocols=offered,
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
