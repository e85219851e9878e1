"""Serve a page until Ctrl-C."""

from __future__ import annotations

import os
import sys
import webbrowser
from collections.abc import Callable

from inspect3d.outcome import InputError
from inspect3d.web.page import Page
from inspect3d.web.server import LOOPBACK, PageServer

WIDE = (
    "Warning: {host} can be reached from other computers, and the connection is not encrypted: whoever reads along can "
    "see and change what the page shows. Without --host the page is for this computer only."
)


def serve(page: Page, host: str, open_browser: bool, tell: Callable[[str], None]) -> None:
    """Serve a page until Ctrl-C, on a port that is free.

    Parameters
    ----------
    page : what to serve
    host : the address to listen on
    open_browser : whether to show the page in the browser of this desktop, where there is one
    tell : given the lines for the terminal

    Raises
    ------
    InputError
        This computer has no such address.
    """
    try:
        server = PageServer(page, host)
    except OSError as error:
        raise InputError(f"--host {host}: this computer cannot listen there ({error.strerror or error}).") from error
    with server:
        if host != LOOPBACK:
            tell(WIDE.format(host=host))
        tell(f"{page.title}: {server.address}")
        tell("The address opens once. Ctrl-C stops.")
        if open_browser and _has_desktop():
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            tell("Stopped.")


def _has_desktop() -> bool:
    """Tell whether a browser would have a window: a text browser would take over the terminal."""
    return sys.platform in ("win32", "darwin") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
