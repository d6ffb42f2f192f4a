"""Who is let in."""

from http import HTTPStatus

import pytest

from smad.view.access import HEADERS, Admitted, Denied, Door

PORT = 8787
OURS = {"host": f"127.0.0.1:{PORT}"}


@pytest.fixture
def door() -> Door:
    return Door(PORT)


def with_cookie(door: Door, token: str, **more: str) -> dict[str, str]:
    return {**OURS, "cookie": f"other=1; {door.cookie_name}={token}", **more}


def test_each_link_gives_its_right_and_a_cookie_that_gives_the_same(door: Door) -> None:
    for token, right in ((door.command, "command"), (door.watch, "watch")):
        first = door.admit(f"/?token={token}", OURS, websocket=False)
        assert isinstance(first, Admitted)
        assert first.right == right
        assert "HttpOnly; SameSite=Strict" in first.cookie
        cookie = first.cookie.partition(";")[0]
        again = door.admit("/view.js", {**OURS, "cookie": cookie}, websocket=False)
        assert again == Admitted(first.right)


def test_the_two_secrets_differ_and_are_new_each_time(door: Door) -> None:
    other = Door(PORT)
    assert len({door.command, door.watch, other.command, other.watch}) == 4
    assert min(map(len, (door.command, door.watch))) >= 43


@pytest.mark.parametrize("target", ["/", "/view.js", "/ws", "/?token=", "/?token=é", "/?x=1"])
def test_a_stranger_gets_nothing(door: Door, target: str) -> None:
    judged = door.admit(target, OURS, websocket=False)
    assert isinstance(judged, Denied)
    assert judged.status == HTTPStatus.UNAUTHORIZED


@pytest.mark.parametrize("cookie", ["", "smad_view_8787=", "smad_view_8787=x", "\udcff;;=", "a=b"])
def test_a_strange_cookie_gets_nothing(door: Door, cookie: str) -> None:
    judged = door.admit("/", {**OURS, "cookie": cookie}, websocket=False)
    assert isinstance(judged, Denied)


@pytest.mark.parametrize("host", ["", "evil.example", "127.0.0.1", "127.0.0.1:1", "0.0.0.0:8787"])
def test_another_host_is_refused_even_with_the_token(door: Door, host: str) -> None:
    judged = door.admit(f"/?token={door.command}", {"host": host}, websocket=False)
    assert isinstance(judged, Denied)
    assert judged.status == HTTPStatus.FORBIDDEN


@pytest.mark.parametrize(
    "origin",
    ["", "null", "http://evil.example", "https://127.0.0.1:8787", "http://127.0.0.1:8788"],
)
def test_a_connection_from_another_page_is_refused_even_with_the_cookie(
    door: Door, origin: str
) -> None:
    judged = door.admit("/ws", with_cookie(door, door.command, origin=origin), websocket=True)
    assert isinstance(judged, Denied)
    assert judged.status == HTTPStatus.FORBIDDEN


def test_our_own_page_may_connect_by_either_name(door: Door) -> None:
    for name in ("127.0.0.1", "localhost"):
        headers = with_cookie(door, door.watch, origin=f"http://{name}:{PORT}")
        headers["host"] = f"{name}:{PORT}"
        assert door.admit("/ws", headers, websocket=True) == Admitted("watch")


def test_a_token_in_the_address_does_not_open_a_connection(door: Door) -> None:
    headers = {**OURS, "origin": f"http://127.0.0.1:{PORT}"}
    assert isinstance(door.admit(f"/ws?token={door.command}", headers, websocket=True), Denied)


def test_a_page_for_watching_only_has_no_secret_that_commands() -> None:
    door = Door(PORT, watch_only=True)
    assert door.command == ""
    assert isinstance(door.admit("/?token=", OURS, websocket=False), Denied)
    assert door.admit("/", with_cookie(door, door.watch), websocket=False) == Admitted("watch")


def test_nothing_from_elsewhere_runs_in_the_page() -> None:
    policy = HEADERS["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
