"""A page in headless Chromium, and what it must not do: complain in the console, or ask anybody but its server."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

import pytest

from inspect3d.web.page import Page
from inspect3d.web.server import PageServer

CHROMIUM = Path("/usr/bin/chromium")
ARGUMENTS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
]
DRIVER = "GL Driver Message"
"""Begins what Chromium's own driver says about speed when pictures are read back; the page has no part in it."""
REFUSED = "the server responded with a status of 422"
PATIENCE = 60_000  # ms


def drawn(page: Any) -> None:
    """Wait until what the page shows has come to rest and is drawn, however slow the machine."""
    page.wait_for_timeout(250)
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


@contextmanager
def serving(page: Page) -> Iterator[PageServer]:
    """Serve a page on a free port while the block runs."""
    with PageServer(page) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@contextmanager
def browser() -> Iterator[Any]:
    """Start Chromium; skip where there is none."""
    if not CHROMIUM.exists():
        pytest.skip(f"there is no {CHROMIUM}; on Debian: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        yield chromium
        chromium.close()


@contextmanager
def opened(chromium: Any, server: PageServer, size: tuple[int, int] = (1280, 720), refused: int = 0) -> Iterator[Any]:
    """Open the page of a server, wait until it shows everything, and see to it that it asked and complained nowhere.

    Chromium itself notes in the console when the server refuses a request in words: `refused` times.
    """
    page = chromium.new_page(viewport={"width": size[0], "height": size[1]})
    page.set_default_timeout(PATIENCE)
    complaints: list[str] = []
    asked: set[str] = set()
    page.on("console", lambda each: complaints.append(each.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: asked.add(request.url))
    page.goto(server.address)
    page.wait_for_selector("body[data-ready=all]")
    yield page
    words = [each for each in complaints if DRIVER not in each]
    assert [each for each in words if REFUSED not in each] == []
    assert len(words) == refused
    assert {urlsplit(url).netloc for url in asked if not url.startswith(("data:", "blob:"))} == {
        f"127.0.0.1:{server.port}"
    }
    page.close(run_before_unload=False)
