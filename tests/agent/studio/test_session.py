"""Who gets in: the browser with the address, from this machine, on pages of ours."""

import http.client
import re
import time
from urllib.parse import urlsplit

import pytest

pytest.importorskip("nicegui", reason="needs tdac[studio]")

from tdac_agent.studio.serve import opened_port
from tdac_agent.studio.session import LASTING, SessionCheck


@pytest.fixture
def ask(studio):
    """Sends a request; gives status, headers and text."""

    def asked(path, method="GET", **headers):
        place = urlsplit(studio.address)
        connection = http.client.HTTPConnection(place.hostname, place.port, timeout=60)
        given = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, headers=given)
        answer = connection.getresponse()
        found = answer.status, answer.headers, answer.read().decode("utf-8", "replace")
        connection.close()
        return found

    return asked


@pytest.fixture
def cookie(studio, ask):
    """The cookie of a browser that was given the address."""
    status, headers, text = ask(f"/?{urlsplit(studio.address).query}")
    assert status == 200
    # The page that follows does not show the token.
    assert "token" not in text
    assert re.search(r"HttpOnly; SameSite=Strict", headers["Set-Cookie"])
    assert headers["Referrer-Policy"] == "no-referrer"
    return headers["Set-Cookie"].partition(";")[0]


SOCKET = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec_WebSocket_Key": "dGhlIHNhbXBsZSBub25jZQ==",
    "Sec_WebSocket_Version": "13",
}
SOCKET_PATH = "/_nicegui_ws/socket.io/?EIO=4&transport=websocket"


@pytest.mark.parametrize(
    "path",
    ["/", "/runs", "/?token=", "/?token=wrong", "/report?at=.", "/file?at=a.png",
     "/_nicegui/auto/static/nicegui.js", SOCKET_PATH],
)  # fmt: skip
def test_without_the_token_nobody_gets_in(ask, path):
    """Neither to a page nor to a file nor to a socket."""
    headers = SOCKET if path == SOCKET_PATH else {}
    status, answer, text = ask(path, **headers)
    assert status == 403
    assert answer["Set-Cookie"] is None
    assert "nicegui" not in text.lower()


def test_who_has_the_cookie_gets_in(studio, ask, cookie):
    assert ask("/runs", Cookie=cookie)[0] == 200
    # The printed address works again, and the token leaves it again.
    text = ask(f"/?{urlsplit(studio.address).query}", Cookie=cookie)[2]
    assert 'content="0; url=/"' in text
    origin = {"Cookie": cookie, "Origin": studio.base}
    assert ask(SOCKET_PATH, **SOCKET, **origin)[0] == 101


def test_pages_of_others(studio, ask, cookie):
    """Their requests are refused even if a browser sent the cookie with them."""
    foreign = {"Cookie": cookie, "Origin": "http://evil.example"}
    assert ask("/runs", **foreign)[0] == 403
    assert ask("/runs", "POST", Cookie=cookie)[0] == 403  # no origin
    assert ask(SOCKET_PATH, **SOCKET, **foreign)[0] == 403
    assert ask(SOCKET_PATH, **SOCKET, Cookie=cookie)[0] == 403
    # A name of another site may lead to this machine.
    port = urlsplit(studio.address).port
    assert ask("/runs", Cookie=cookie, Host=f"evil.example:{port}")[0] == 403


def test_files_outside_of_the_folder(studio, ask, cookie):
    (studio.place.parent / "secret.png").write_bytes(b"secret")
    (studio.place / "link.png").symlink_to(studio.place.parent / "secret.png")
    (studio.place / "notes.txt").write_text("no picture")
    for at in ("../secret.png", "link.png", "/etc/passwd", "notes.txt", "a\0b.png"):
        assert ask(f"/file?at={at.replace(chr(0), '%00')}", Cookie=cookie)[0] == 404
    (studio.place / "own.png").write_bytes(b"picture")
    status, headers, _ = ask("/file?at=own.png", Cookie=cookie)
    assert status == 200
    rights = "sandbox; default-src 'unsafe-inline' data:"
    assert headers["Content-Security-Policy"] == rights


def test_a_cookie_is_good_for_a_week_and_for_one_folder(tmp_path, monkeypatch):
    """Also after a restart: the check of another process accepts it."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    session = SessionCheck(None, 8501, tmp_path)
    now = int(time.time())

    def gets_in(content, port=8501, place=tmp_path):
        headers = {"cookie": f"tdac-studio-{port}={content}"}
        return SessionCheck(None, port, place)._has_session(headers)

    assert gets_in(session._session(now))
    assert gets_in(session._session(now - LASTING + 60))
    assert not gets_in(session._session(now - LASTING - 60))
    assert not gets_in(session._session(now + 60))
    assert not gets_in(session._session(now), port=8502)
    assert not gets_in(session._session(now), place=tmp_path / "other")
    mac = session._session(now).partition(".")[2]
    for forged in (
        "",
        ".",
        mac,
        f"{now}",
        f"{now}.",
        f"{now - 1}.{mac}",
        f"x.{mac}",
        "9" * 5000,
    ):
        assert not gets_in(forged), forged


def test_a_folder_has_the_port_of_the_last_start(tmp_path):
    """Unless another program has taken it, or the note is no port."""
    with opened_port(tmp_path, 0) as first:
        port = first.getsockname()[1]
        with opened_port(tmp_path, 0) as second:  # another studio in the same folder
            other = second.getsockname()[1]
            assert other != port
            with pytest.raises(OSError, match="in use"):
                opened_port(tmp_path, port)
    with opened_port(tmp_path, 0) as again:
        assert again.getsockname()[1] == other
    for wrong in ("", "80", "70000", "-1", "x" * 100):
        (tmp_path / ".studio" / "port").write_text(wrong)
        with opened_port(tmp_path, 0) as free:
            assert free.getsockname()[1] >= 1024
