"""Who is let in."""

from http import HTTPStatus

import pytest

from smad.view.access import HEADERS, AccessControl, Admitted, Denied, Right

PORT = 8787
OURS = {"host": f"127.0.0.1:{PORT}"}


@pytest.fixture
def access() -> AccessControl:
    return AccessControl(PORT)


def with_cookie(access: AccessControl, **more: str) -> dict[str, str]:
    return {**OURS, "cookie": f"other=1; {access.cookie_name}={access.cookie}", **more}


def from_page(
    access: AccessControl, key: str, origin: str = f"http://127.0.0.1:{PORT}"
) -> dict[str, str]:
    offered = {"sec-websocket-protocol": f"smad, key.{key}"}
    return with_cookie(access, origin=origin, **offered)


def test_each_link_gives_a_cookie_for_files_and_a_key_for_its_right(access: AccessControl) -> None:
    rights: tuple[tuple[str, Right], ...] = ((access.command, "command"), (access.watch, "watch"))
    for token, right in rights:
        first = access.admit(f"/?token={token}", OURS, websocket=False)
        assert isinstance(first, Admitted)
        assert "HttpOnly; SameSite=Strict" in first.cookie
        cookie = first.cookie.partition(";")[0]
        again = access.admit("/view.js", {**OURS, "cookie": cookie}, websocket=False)
        assert again == Admitted()
        headers = {**from_page(access, first.key), "cookie": cookie}
        assert access.admit("/ws", headers, websocket=True) == Admitted(right)


def secrets_of(access: AccessControl) -> list[str]:
    return [access.command, access.watch, access.cookie, *access.keys.values()]


def test_all_secrets_differ_and_are_new_each_time(access: AccessControl) -> None:
    both = secrets_of(access) + secrets_of(AccessControl(PORT))
    assert len(set(both)) == 10
    assert min(map(len, both)) >= 43


def test_a_cookie_alone_gives_no_connection_no_key_and_is_no_token(access: AccessControl) -> None:
    for offered in ("", "smad", f"smad, key.{access.cookie}", "smad, key.", "smad, key.\udcff"):
        headers = {**from_page(access, ""), "sec-websocket-protocol": offered}
        judged = access.admit("/ws", headers, websocket=True)
        assert isinstance(judged, Denied)
        assert judged.status == HTTPStatus.UNAUTHORIZED
    assert access.admit("/", with_cookie(access), websocket=False) == Admitted()
    judged = access.admit(f"/?token={access.cookie}", with_cookie(access), websocket=False)
    assert isinstance(judged, Denied)


def test_a_link_token_is_no_key_and_a_key_alone_no_connection(access: AccessControl) -> None:
    assert isinstance(
        access.admit("/ws", from_page(access, access.command), websocket=True), Denied
    )
    alone = from_page(access, access.keys["command"])
    del alone["cookie"]
    assert isinstance(access.admit("/ws", alone, websocket=True), Denied)


@pytest.mark.parametrize("target", ["/", "/view.js", "/ws", "/?token=", "/?token=é", "/?x=1"])
def test_a_stranger_gets_nothing(access: AccessControl, target: str) -> None:
    judged = access.admit(target, OURS, websocket=False)
    assert isinstance(judged, Denied)
    assert judged.status == HTTPStatus.UNAUTHORIZED


@pytest.mark.parametrize("cookie", ["", "smad_view_8787=", "smad_view_8787=x", "\udcff;;=", "a=b"])
def test_a_strange_cookie_gets_nothing(access: AccessControl, cookie: str) -> None:
    judged = access.admit("/", {**OURS, "cookie": cookie}, websocket=False)
    assert isinstance(judged, Denied)


@pytest.mark.parametrize("host", ["", "evil.example", "127.0.0.1", "127.0.0.1:1", "0.0.0.0:8787"])
def test_another_host_is_refused_even_with_the_token(access: AccessControl, host: str) -> None:
    judged = access.admit(f"/?token={access.command}", {"host": host}, websocket=False)
    assert isinstance(judged, Denied)
    assert judged.status == HTTPStatus.FORBIDDEN


@pytest.mark.parametrize(
    "origin",
    ["", "null", "http://evil.example", "https://127.0.0.1:8787", "http://127.0.0.1:8788"],
)
def test_a_connection_from_another_page_is_refused_even_with_cookie_and_key(
    access: AccessControl, origin: str
) -> None:
    judged = access.admit("/ws", from_page(access, access.keys["command"], origin), websocket=True)
    assert isinstance(judged, Denied)
    assert judged.status == HTTPStatus.FORBIDDEN


def test_our_own_page_may_connect_by_either_name(access: AccessControl) -> None:
    for name in ("127.0.0.1", "localhost"):
        headers = from_page(access, access.keys["watch"], f"http://{name}:{PORT}")
        headers["host"] = f"{name}:{PORT}"
        assert access.admit("/ws", headers, websocket=True) == Admitted("watch")


def test_a_token_in_the_address_does_not_open_a_connection(access: AccessControl) -> None:
    headers = {**OURS, "origin": f"http://127.0.0.1:{PORT}"}
    assert isinstance(access.admit(f"/ws?token={access.command}", headers, websocket=True), Denied)


def test_a_page_for_watching_only_has_no_secret_that_commands() -> None:
    access = AccessControl(PORT, watch_only=True)
    assert access.command == ""
    assert isinstance(access.admit("/?token=", OURS, websocket=False), Denied)
    assert isinstance(access.admit("/ws", from_page(access, ""), websocket=True), Denied)
    seen = access.admit("/ws", from_page(access, access.keys["watch"]), websocket=True)
    assert seen == Admitted("watch")


def test_nothing_from_elsewhere_runs_in_the_page() -> None:
    policy = HEADERS["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
