"""Who may ask the server, and what it gives away."""

from __future__ import annotations

import json
from http.client import HTTPConnection

import pytest

from inspect3d.outcome import InputError
from inspect3d.web.page import Answer, Page, Request
from inspect3d.web.serve import serve
from inspect3d.web.server import MOST, PageServer
from tests.browsing import serving


def _counted(request: Request) -> Answer:
    return Answer.json(request.index("number", 3))


def _told(request: Request) -> Answer:
    return Answer.json(request.body)


def _broken(request: Request) -> Answer:
    raise ZeroDivisionError("division by zero")


@pytest.fixture
def server():
    page = Page(
        "view",
        ("view.html", "view.js", "surface.js", "page.css"),
        {"count": _counted, "broken": _broken},
        {"tell": _told},
    )
    with serving(page) as started:
        yield started


def asked(server: PageServer, method: str, path: str, body: bytes = b"", **headers: str) -> tuple[int, str, dict]:
    """Return status, text and headers of an answer; `Cookie` and others as keywords, with _ for -."""
    connection = HTTPConnection("127.0.0.1", server.port, timeout=10)
    known = {name.replace("_", "-"): value for name, value in headers.items()}
    connection.putrequest(method, path, skip_host="Host" in known)
    for name, value in known.items():
        connection.putheader(name, value)
    if method == "POST" and "Content-Length" not in known:
        connection.putheader("Content-Length", str(len(body)))
    connection.endheaders(body)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text, dict(answer.getheaders())


def let_in(server: PageServer) -> str:
    """Return the cookie for the token."""
    status, _, headers = asked(server, "GET", f"/?token={server.door.token}")
    assert (status, headers["Location"]) == (303, "/")
    assert "HttpOnly; SameSite=Strict" in headers["Set-Cookie"]
    return headers["Set-Cookie"].partition(";")[0]


def test_the_server_listens_on_loopback_only_and_its_address_holds_the_token(server):
    assert server.server_address[0] == "127.0.0.1"
    assert server.address == f"http://127.0.0.1:{server.port}/?token={server.door.token}"
    assert len(server.door.token) >= 32


def test_a_wrong_token_is_refused_and_the_right_one_opens_once(server):
    for token in ("", "wrong", server.door.token[:-1]):
        assert asked(server, "GET", f"/?token={token}")[0] == 403
    cookie = let_in(server)
    status, words, _ = asked(server, "GET", f"/?token={server.door.token}")
    assert status == 403
    assert "has been used" in words
    assert asked(server, "GET", "/", Cookie=cookie)[0] == 200
    assert asked(server, "GET", f"/?token={server.door.token}", Cookie=cookie)[0] == 303
    assert asked(server, "GET", "/", Cookie=cookie[:-1])[0] == 403


@pytest.mark.parametrize("path", ["/", "/view.js", "/count?number=1", "/../../etc/passwd"])
def test_nothing_is_given_away_without_the_cookie(server, path):
    assert asked(server, "GET", path)[0] == 403


@pytest.mark.parametrize(
    "path",
    [
        "/../pyproject.toml",
        "/..%2f..%2fpyproject.toml",
        "//etc/passwd",
        "/etc/passwd",
        "/view.js/../../server.py",
        "/server.py",
        "/pick.html",
        "/assets/view.js",
        "/view.js%00",
        "/.",
    ],
)
def test_no_path_leads_out_of_what_the_page_shows(server, path):
    status, words, _ = asked(server, "GET", path, Cookie=let_in(server))
    assert (status, words) == (404, "There is nothing here.")


def test_every_answer_forbids_the_page_all_other_addresses(server):
    for path in ("/", "/count?number=1", "/nothing"):
        headers = asked(server, "GET", path, Cookie=let_in(server) if path == "/" else f"x={server.door.session}")[2]
        policy = headers["Content-Security-Policy"]
        assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self';")
        assert "unsafe" not in policy
        assert "http" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff"


def test_another_name_for_the_server_is_refused_so_that_no_site_can_take_its_name(server):
    cookie = let_in(server)
    for name in ("evil.example", f"evil.example:{server.port}", "127.0.0.1:1", ""):
        assert asked(server, "GET", "/", Cookie=cookie, Host=name)[0] == 403
    assert asked(server, "GET", "/", Cookie=cookie, Host=f"localhost:{server.port}")[0] == 200


def test_only_the_page_itself_may_change_anything(server):
    cookie, origin = let_in(server), f"http://127.0.0.1:{server.port}"
    assert asked(server, "POST", "/tell", b'{"a": 1}', Cookie=cookie, Origin=origin)[:2] == (200, '{"a": 1}')
    assert asked(server, "POST", "/tell", b"{}", Cookie=cookie)[0] == 403
    assert asked(server, "POST", "/tell", b"{}", Cookie=cookie, Origin="http://evil.example")[0] == 403
    assert asked(server, "POST", "/tell", b"{}", Origin=origin)[0] == 403
    assert asked(server, "POST", "/count", b"{}", Cookie=cookie, Origin=origin)[0] == 404
    assert asked(server, "POST", "/tell", b"no JSON", Cookie=cookie, Origin=origin)[0] == 400
    assert asked(server, "POST", "/tell", b"[" * 100_000, Cookie=cookie, Origin=origin)[0] == 400
    assert asked(server, "POST", "/tell", Cookie=cookie, Origin=origin, Content_Length=str(MOST + 1))[0] == 413
    assert asked(server, "PUT", "/tell", b"", Cookie=cookie, Origin=origin)[0] == 501


def test_a_wrong_parameter_is_refused_in_words(server):
    cookie = let_in(server)
    assert json.loads(asked(server, "GET", "/count?number=2", Cookie=cookie)[1]) == 2
    for number in ("3", "-1", "x", "", "1e3", "9" * 50):
        status, words, _ = asked(server, "GET", f"/count?number={number}", Cookie=cookie)
        assert (status, words) == (422, f"number = {number!r} chooses none of 3.")


def test_a_mistake_of_ours_is_told_the_page_and_does_not_look_like_a_server_that_is_gone(server):
    status, words, _ = asked(server, "GET", "/broken", Cookie=let_in(server))
    assert status == 500
    assert words.startswith("inspect3d made a mistake of its own (ZeroDivisionError: division by zero)")


def test_every_server_has_a_port_of_its_own():
    page = Page("view", ("view.html",), {}, {})
    with PageServer(page) as one, PageServer(page) as other:
        assert one.port != other.port
        assert one.door.token != other.door.token


def test_a_host_that_is_not_this_computer_is_refused_in_a_sentence():
    page = Page("view", ("view.html",), {}, {})
    with pytest.raises(InputError, match=r"--host 203\.0\.113\.1: this computer cannot listen there"):
        serve(page, "203.0.113.1", False, print)


def test_another_host_than_loopback_is_warned_of(monkeypatch):
    def interrupted(self):
        raise KeyboardInterrupt

    monkeypatch.setattr(PageServer, "serve_forever", interrupted)
    said = []
    serve(Page("pick", ("pick.html",), {}, {}), "0.0.0.0", False, said.append)
    assert said[0].startswith("Warning: 0.0.0.0 can be reached from other computers")
    assert said[1].startswith("pick: http://")
    assert said[-1] == "Stopped."
    said.clear()
    serve(Page("pick", ("pick.html",), {}, {}), "127.0.0.1", False, said.append)
    assert len(said) == 3
