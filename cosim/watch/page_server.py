"""The page's server: a few files of this package, and what a session knows, as JSON."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable
from functools import partial
from http.server import BaseHTTPRequestHandler
from importlib import resources
from socketserver import TCPServer, ThreadingMixIn
from typing import Any
from urllib.parse import parse_qs, urlsplit

from cosim.errors import PlotError, UsageError
from cosim.plot import motion, player
from cosim.results.metrics import for_json
from cosim.watch import curve_views
from cosim.watch.guard import HEADERS, HOST, Guard
from cosim.watch.orders import View
from cosim.watch.session import WatchSession

FILES = {
    "": ("cosim.watch", "page.html", "text/html"),
    "page.css": ("cosim.watch", "page.css", "text/css"),
    "page.js": ("cosim.watch", "page.js", "text/javascript"),
    "plots.js": ("cosim.watch", "plots.js", "text/javascript"),
    "player.js": ("cosim.plot", "player.js", "text/javascript"),
}
"""What the page is made of: by its path, the package, the file and its type."""
LONGEST = 1_000_000
"""Bytes that a page may send at once."""
PATIENCE = 15.0
"""Seconds after which a page that is told nothing is told that: so it is seen where one has gone."""
SILENCE = 30.0
"""Seconds for which a request may be on its way."""


class PageServer(ThreadingMixIn, TCPServer):
    """Listens on this machine's own address alone; port 0 is any that is free. Raises: UsageError for one in use."""

    daemon_threads = True
    allow_reuse_address = True
    request_queue_size = 64

    def __init__(self, session: WatchSession, port: int) -> None:
        try:
            super().__init__((HOST, port), partial(_Handler, session))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise UsageError(f"cannot listen on port {port}: {reason}", fix="--port 0 takes one that is free") from None
        self.guard = Guard(self.server_address[1])

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A page that has gone is no news."""


class _Handler(BaseHTTPRequestHandler):
    """One connection of a page."""

    protocol_version = "HTTP/1.1"
    server: PageServer
    timeout = SILENCE

    def __init__(self, session: WatchSession, *connection: Any) -> None:
        self._session = session
        super().__init__(*connection)

    def setup(self) -> None:
        """Small answers leave at once."""
        super().setup()
        self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def version_string(self) -> str:
        """What it is; not of which version."""
        return "cosim"

    def log_message(self, format: str, *arguments: Any) -> None:  # noqa: A002  # its name
        """Nothing is printed."""

    def do_GET(self) -> None:  # its name
        """Answer what changes nothing."""
        path = self._admitted()
        if path is None:
            return
        parts = urlsplit(path)
        asked = {name: values[-1] for name, values in parse_qs(parts.query).items()}
        answers: dict[str, Callable[[], None]] = {
            "events": self._events,
            "drawing": lambda: self._send(self._session.drawing.encode(), "image/svg+xml"),
            "sliders": lambda: self._json(self._session.sliders),
            "block": lambda: self._json(self._session.block(asked.get("name", ""))),
            "motion": lambda: self._json(self._motion(asked)),
        }
        if parts.path in FILES:
            package, name, kind = FILES[parts.path]
            self._send(resources.files(package).joinpath(name).read_bytes(), f"{kind}; charset=utf-8")
        elif parts.path in answers:
            answers[parts.path]()
        else:
            self.send_error(404)

    def do_POST(self) -> None:  # its name
        """Do what the page wants."""
        path = self._admitted()
        wanted = None if path is None else self._body()
        if wanted is None:
            return
        try:
            if path == "slide":
                self._session.slide({str(k): float(v) for k, v in wanted["values"].items()})
                self._json({})
            elif path == "show":
                self._session.show(str(wanted["signal"]))
                self._json({})
            elif path == "curves":
                self._json(self._curves(wanted))
            else:
                self.send_error(404)
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, OverflowError):
            self.send_error(400)

    # ---- requests ----

    def _admitted(self) -> str | None:
        """What is asked for; a stranger is sent away."""
        path = self.server.guard.admits(self.path, dict(self.headers.items()))
        if path is None:
            self.close_connection = True
            self.send_error(403, "the address that `cosim watch` has printed leads here, and no other")
        return path

    def _body(self) -> Any:
        """What a page sends, as JSON; None where it is none."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > LONGEST:
            self.close_connection = True
            self.send_error(413)
            return None
        try:
            return json.loads(self.rfile.read(int(length)))
        except ValueError:
            self.send_error(400)
            return None

    # ---- answers ----

    def _send(self, content: bytes, kind: str) -> None:
        self.send_response(200)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def end_headers(self) -> None:
        """With what every answer says."""
        for name, value in HEADERS.items():
            self.send_header(name, value)
        super().end_headers()

    def _json(self, content: Any) -> None:
        self._send(_text(content).encode(), "application/json")

    def _events(self) -> None:
        """The state, whenever it changes, until the page goes."""
        self.close_connection = True
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.end_headers()
        version = 0
        while True:
            version, state = self._session.wait(version, PATIENCE)
            self.wfile.write(f"data: {_text(state)}\n\n".encode() if state else b": nothing new\n\n")

    def _curves(self, wanted: View) -> View:
        """Plots of one time span, of several runs."""
        runs = []
        for number in wanted["runs"]:
            track = self._session.track(number)
            if track is None:  # another run has taken its place
                runs.append({"number": number, "span": None, "plots": None})
                continue
            span = curve_views.span_of(track)
            window = wanted["span"] or span or (0.0, 0.0)
            width = min(max(int(wanted["width"]), 10), 10_000)
            plots = [curve_views.window(track, plot, window, width) for plot in wanted["plots"]]
            runs.append({"number": number, "span": span, "plots": plots})
        return {"runs": runs}

    def _motion(self, asked: dict[str, str]) -> View | None:
        """What moves in a run; None where nothing does."""
        track = self._session.track(int(asked.get("run", "0"))) if asked.get("run", "").isdecimal() else None
        if track is None:
            return None
        try:
            return player.packed(motion.read(track, motion.find(track, motion.Motion())))
        except PlotError:
            return None


def _text(content: Any) -> str:
    return json.dumps(for_json(content), ensure_ascii=False, separators=(",", ":"))
