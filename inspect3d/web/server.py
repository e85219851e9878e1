"""A web server for one page and one user: on loopback, behind a token, with nothing to read but what the page shows.

Python's own `http.server`, not a framework: the pages ask for a dozen named things and are sent bytes. No request
names a path, so no path can lead out of the folders of the recipe or of the results.
"""

from __future__ import annotations

import json
import secrets
import socket
from dataclasses import dataclass, field
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from inspect3d.outcome import InspectionError
from inspect3d.web.page import Answer, Page, Request

LOOPBACK = "127.0.0.1"
MOST = 10_000_000  # bytes a page may send
PATIENCE = 30.0  # s an idle connection is kept
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
SPENT = "This address has been used, or its token is wrong. Stop the command and start it again for a new one."
STRANGE = "This request did not come from the page."
NOTHING = "There is nothing here."
OWN_MISTAKE = "inspect3d made a mistake of its own ({}: {}); please report it."


@dataclass
class Doorkeeper:
    """Who may come in: whoever brings the token first gets a cookie for the rest.

    Parameters
    ----------
    token : stands in the address, and opens once
    session : the value of the cookie
    """

    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    session: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    spent: bool = False
    lock: Lock = field(default_factory=Lock)

    def opens(self, token: str) -> bool:
        """Tell whether the token is right and new; it is spent from then on."""
        with self.lock:
            right = not self.spent and secrets.compare_digest(token.encode(), self.token.encode())
            self.spent = self.spent or right
            return right

    def knows(self, session: str) -> bool:
        """Tell whether the cookie is right."""
        return secrets.compare_digest(session.encode(), self.session.encode())


class PageServer(ThreadingHTTPServer):
    """The server of one page, listening from the moment it is made; `serve_forever` answers."""

    daemon_threads = True
    request_queue_size = 64

    def __init__(self, page: Page, host: str = LOOPBACK) -> None:
        self.page, self.host, self.door = page, host, Doorkeeper()
        self.address_family = socket.AF_INET6 if ":" in host else socket.AF_INET
        super().__init__((host, 0), _Handler)

    @property
    def port(self) -> int:
        """Return the port, which was free."""
        return int(self.server_address[1])

    @property
    def address(self) -> str:
        """Return the address to open, with the token."""
        name = {"0.0.0.0": socket.gethostname(), "::": socket.gethostname()}.get(self.host, self.host)
        return f"http://{f'[{name}]' if ':' in name else name}:{self.port}/?token={self.door.token}"

    def is_called(self, name: str) -> bool:
        """Tell whether a `Host` is this server's: on loopback no other name will do (DNS rebinding)."""
        host, _, port = name.rpartition(":")
        return port == str(self.port) and (self.host != LOOPBACK or host in (LOOPBACK, "localhost"))

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say nothing of connections the browser broke off."""


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "inspect3d", ""
    timeout = PATIENCE

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        query = dict(parse_qsl(parts.query))
        if not self.server.is_called(self.headers.get("Host", "")):
            self._refuse(HTTPStatus.FORBIDDEN, STRANGE)
        elif parts.path == "/" and self.server.door.opens(query.get("token", "")):
            self._welcome()
        elif not self._known():
            self._refuse(HTTPStatus.FORBIDDEN, SPENT)
        elif parts.path == "/" and "token" in query:
            self._welcome()
        elif asset := self.server.page.asset(parts.path[1:]):
            self._send(HTTPStatus.OK, asset)
        else:
            self._answer(self.server.page.get, Request(parts.path[1:], query))

    def do_POST(self) -> None:
        length = self.headers.get("Content-Length", "")
        if not (length.isascii() and length.isdigit() and len(length) < 10 and int(length) <= MOST):
            self.close_connection = True
            self._refuse(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "The page sent too much.")
            return
        body = self.rfile.read(int(length))
        origin = self.headers.get("Origin", "")
        if not (self.server.is_called(self.headers.get("Host", "")) and origin == f"http://{self.headers['Host']}"):
            self._refuse(HTTPStatus.FORBIDDEN, STRANGE)
        elif not self._known():
            self._refuse(HTTPStatus.FORBIDDEN, SPENT)
        else:
            try:
                sent = json.loads(body)
            except (ValueError, RecursionError):
                self._refuse(HTTPStatus.BAD_REQUEST, "The page sent no JSON.")
                return
            self._answer(self.server.page.post, Request(urlsplit(self.path).path[1:], {}, sent))

    def log_message(self, format: str, *args: Any) -> None:
        """Keep requests off the terminal."""

    @property
    def _cookie(self) -> str:
        return f"inspect3d-{self.server.port}"

    def _known(self) -> bool:
        crumbs = [crumb.strip().partition("=") for crumb in self.headers.get("Cookie", "").split(";")]
        return any(name == self._cookie and self.server.door.knows(value) for name, _, value in crumbs)

    def _welcome(self) -> None:
        cookie = f"{self._cookie}={self.server.door.session}; HttpOnly; SameSite=Strict; Path=/"
        self._send(HTTPStatus.SEE_OTHER, Answer(b"", "text/plain"), {"Location": "/", "Set-Cookie": cookie})

    def _answer(self, known: Any, request: Request) -> None:
        if request.name not in known:
            self._refuse(HTTPStatus.NOT_FOUND, NOTHING)
            return
        try:
            answer = known[request.name](request)
        except (InspectionError, OSError) as error:
            self._refuse(HTTPStatus.UNPROCESSABLE_ENTITY, str(error))
            return
        except Exception as error:
            self._refuse(HTTPStatus.INTERNAL_SERVER_ERROR, OWN_MISTAKE.format(type(error).__name__, error))
            return
        self._send(HTTPStatus.OK, answer)

    def _refuse(self, status: HTTPStatus, words: str) -> None:
        self._send(status, Answer(words.encode(), "text/plain; charset=utf-8"))

    def _send(self, status: HTTPStatus, answer: Answer, more: dict[str, str] | None = None) -> None:
        self.send_response(status)
        for name, value in {**HEADERS, **(more or {})}.items():
            self.send_header(name, value)
        self.send_header("Content-Type", answer.kind)
        self.send_header("Content-Length", str(len(answer.body)))
        self.end_headers()
        self.wfile.write(answer.body)
