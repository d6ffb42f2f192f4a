"""The example for nginx: a page that only watches, through the proxy, with the secrets of smad.

Where there is no nginx these tests are skipped; with SMAD_REQUIRE_NGINX set (as in .ci/run) they
fail instead. The example's certificate is replaced by plain HTTP on a free port of this machine.
"""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import socket
import subprocess
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit
from urllib.request import Request, urlopen

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin, Subprotocol

from smad.client.endpoints import FOLDER_VARIABLE
from smad.view.server import LivePage, serving

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "nginx" / "smad.conf"
NGINX = shutil.which("nginx", path=f"{os.environ['PATH']}:/usr/sbin")
pytestmark = pytest.mark.skipif(
    NGINX is None and not os.environ.get("SMAD_REQUIRE_NGINX"), reason="there is no nginx here"
)


class Proxied(NamedTuple):
    """A page behind nginx: what serves it, and the address of the proxy."""

    page: LivePage
    address: str


@pytest.fixture
async def proxied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Proxied]:
    assert NGINX is not None
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path))
    async with serving("nobody", 0, watch_only=True) as page:
        port = free_port()
        served = urlsplit(page.links.watch).port
        config = tmp_path / "nginx.conf"
        config.write_text(configuration(tmp_path, port, f"127.0.0.1:{served}"))
        nginx = subprocess.Popen([NGINX, "-c", str(config), "-g", "daemon off;"])
        try:
            await until_it_listens(port)
            yield Proxied(page, f"127.0.0.1:{port}")
        finally:
            nginx.terminate()
            nginx.wait(20.0)


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def configuration(folder: Path, port: int, upstream: str) -> str:
    """The example as it is shipped, on plain HTTP and a port of its own."""
    text = EXAMPLE.read_text().replace("127.0.0.1:8788", upstream)
    text = text.replace("listen 443 ssl;", f"listen 127.0.0.1:{port};")
    text = re.sub(r"\n +ssl_certificate.*", "", text)
    text = text.replace("https://bench.lab.example ", f"http://127.0.0.1:{port} ")
    places = "".join(
        f"{name}_temp_path {folder}/{name};\n"
        for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    return (
        f"pid {folder}/nginx.pid;\nerror_log {folder}/error.log;\nevents {{}}\n"
        f"http {{\n{places}{text}}}\n"
    )


async def until_it_listens(port: int) -> None:
    for _ in range(10_000):
        try:
            _, writer = await asyncio.open_connection("127.0.0.1", port)
        except OSError:
            await asyncio.sleep(0.01)
        else:
            writer.close()
            return
    raise RuntimeError("nginx does not listen")


def get(address: str, **headers: str) -> tuple[str, str]:
    """Return the body of a page and the cookie that came with it."""
    with urlopen(Request(address, headers=headers), timeout=120.0) as reply:
        return reply.read().decode(), reply.headers.get("Set-Cookie", "")


async def page_of(proxied: Proxied) -> tuple[str, str, str]:
    """The page that the link gives through the proxy, its cookie and its key."""
    token = urlsplit(proxied.page.links.watch).query
    text, cookie = await asyncio.to_thread(get, f"http://{proxied.address}/?{token}")
    key = re.search(r'name="smad-key" content="([\w-]+)"', text)
    assert key is not None
    return text, cookie.partition(";")[0], key[1]


async def opened(proxied: Proxied, origin: str) -> ClientConnection:
    _, cookie, key = await page_of(proxied)
    return await connect(
        f"ws://{proxied.address}/ws",
        origin=Origin(origin),
        additional_headers={"Cookie": cookie},
        subprotocols=[Subprotocol("smad"), Subprotocol(f"key.{key}")],
    )


async def test_the_link_opens_a_page_that_watches_and_cannot_command(proxied: Proxied) -> None:
    connection = await opened(proxied, f"http://{proxied.address}")
    hello: dict[str, Any] = json.loads(await connection.recv())
    assert (hello["type"], hello["right"]) == ("hello", "watch")
    await connection.send(json.dumps({"do": "arm", "id": 5}))
    while (reply := json.loads(await connection.recv()))["type"] != "reply":
        pass
    assert (reply["id"], reply["done"]) == (5, False)
    await connection.close()


async def test_the_cookie_is_for_https_alone_and_for_no_script(proxied: Proxied) -> None:
    token = urlsplit(proxied.page.links.watch).query
    _, cookie = await asyncio.to_thread(get, f"http://{proxied.address}/?{token}")
    assert {"HttpOnly", "SameSite=Strict", "Secure"} <= {p.strip() for p in cookie.split(";")}


async def test_a_page_of_another_site_is_refused_by_the_proxy(proxied: Proxied) -> None:
    with pytest.raises(InvalidStatus) as refused:
        await opened(proxied, "http://elsewhere.example")
    assert refused.value.response.status_code == 403


@pytest.mark.parametrize("query", ["", "?token=wrong"])
async def test_without_the_token_there_is_no_page(proxied: Proxied, query: str) -> None:
    from urllib.error import HTTPError

    with pytest.raises(HTTPError, match="401"):
        await asyncio.to_thread(get, f"http://{proxied.address}/{query}")


async def test_nothing_but_reading_passes(proxied: Proxied) -> None:
    from urllib.error import HTTPError

    def post() -> None:
        urlopen(Request(f"http://{proxied.address}/", data=b"x", method="POST"), timeout=120.0)

    with pytest.raises(HTTPError, match="403"):
        await asyncio.to_thread(post)
