"""Who is let in."""

from http import HTTPStatus

import pytest

from smad.view.access import HEADERS, Admitted, Denied, Door, Right

PORT = 8787
OURS = {"host": f"127.0.0.1:{PORT}"}


@pytest.fixture
def door() -> Door:
    return Door(PORT)


def with_cookie(door: Door, **more: str) -> dict[str, str]:
    return {**OURS, "cookie": f"other=1; {door.cookie_name}={door.cookie}", **more}


def from_page(door: Door, key: str, origin: str = f"http://127.0.0.1:{PORT}") -> dict[str, str]:
    offered = {"sec-websocket-protocol": f"smad, key.{key}"}
    return with_cookie(door, origin=origin, **offered)


def test_each_link_gives_a_cookie_for_files_and_a_key_for_its_right(door: Door) -> None:
    rights: tuple[tuple[str, Right], ...] = ((door.command, "command"), (door.watch, "watch"))
    for token, right in rights:
        first = door.admit(f"/?token={token}", OURS, websocket=False)
        assert isinstance(first, Admitted)
        assert "HttpOnly; SameSite=Strict" in first.cookie
        cookie = first.cookie.partition(";")[0]
        again = door.admit("/view.js", {**OURS, "cookie": cookie}, websocket=False)
        assert again == Admitted()
        headers = {**from_page(door, first.key), "cookie": cookie}
        assert door.admit("/ws", headers, websocket=True) == Admitted(right)


def secrets_of(door: Door) -> list[str]:
    return [door.command, door.watch, door.cookie, *door.keys.values()]


def test_all_secrets_differ_and_are_new_each_time(door: Door) -> None:
    both = secrets_of(door) + secrets_of(Door(PORT))
    assert len(set(both)) == 10
    assert min(map(len, both)) >= 43


def test_a_cookie_alone_gives_no_connection_no_key_and_is_no_token(door: Door) -> None:
    for offered in ("", "smad", f"smad, key.{door.cookie}", "smad, key.", "smad, key.\udcff"):
        headers = {**from_page(door, ""), "sec-websocket-protocol": offered}
        judged = door.admit("/ws", headers, websocket=True)
        assert isinstance(judged, Denied)
        assert judged.status == HTTPStatus.UNAUTHORIZED
    assert door.admit("/", with_cookie(door), websocket=False) == Admitted()
    judged = door.admit(f"/?token={door.cookie}", with_cookie(door), websocket=False)
    assert isinstance(judged, Denied)


def test_a_link_token_is_no_key_and_a_key_alone_no_connection(door: Door) -> None:
    assert isinstance(door.admit("/ws", from_page(door, door.command), websocket=True), Denied)
    alone = from_page(door, door.keys["command"])
    del alone["cookie"]
    assert isinstance(door.admit("/ws", alone, websocket=True), Denied)


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
def test_a_connection_from_another_page_is_refused_even_with_cookie_and_key(
    door: Door, origin: str
) -> None:
    judged = door.admit("/ws", from_page(door, door.keys["command"], origin), websocket=True)
    assert isinstance(judged, Denied)
    assert judged.status == HTTPStatus.FORBIDDEN


def test_our_own_page_may_connect_by_either_name(door: Door) -> None:
    for name in ("127.0.0.1", "localhost"):
        headers = from_page(door, door.keys["watch"], f"http://{name}:{PORT}")
        headers["host"] = f"{name}:{PORT}"
        assert door.admit("/ws", headers, websocket=True) == Admitted("watch")


def test_a_token_in_the_address_does_not_open_a_connection(door: Door) -> None:
    headers = {**OURS, "origin": f"http://127.0.0.1:{PORT}"}
    assert isinstance(door.admit(f"/ws?token={door.command}", headers, websocket=True), Denied)


def test_a_page_for_watching_only_has_no_secret_that_commands() -> None:
    door = Door(PORT, watch_only=True)
    assert door.command == ""
    assert isinstance(door.admit("/?token=", OURS, websocket=False), Denied)
    assert isinstance(door.admit("/ws", from_page(door, ""), websocket=True), Denied)
    seen = door.admit("/ws", from_page(door, door.keys["watch"]), websocket=True)
    assert seen == Admitted("watch")


def test_nothing_from_elsewhere_runs_in_the_page() -> None:
    policy = HEADERS["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
