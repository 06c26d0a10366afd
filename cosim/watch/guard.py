"""Who may ask the page's server: this machine, by the address that was told, with the token, from the page itself."""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field

HOST = "127.0.0.1"
NAMES = (HOST, "localhost")
"""What a browser may call this machine: a name of somebody else's that leads here is refused (DNS rebinding)."""
_SAME = ("same-origin", "none")
"""What a browser says of a request that comes from the page itself, or from a person."""
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; connect-src 'self';"
        " img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
"""Of every answer: nothing from elsewhere is loaded, nothing is shown within another page, and no address is told."""


@dataclass(frozen=True)
class Guard:
    """port: of the server. token: the first part of every path, which nobody guesses."""

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    @property
    def address(self) -> str:
        """Of the page."""
        return f"http://{HOST}:{self.port}/{self.token}/"

    def admits(self, path: str, headers: Mapping[str, str]) -> str | None:
        """What is asked for, below the token; None for a stranger."""
        hosts = [f"{name}:{self.port}" for name in NAMES]
        origin = headers.get("Origin")
        if headers.get("Host") not in hosts or headers.get("Sec-Fetch-Site", "none") not in _SAME:
            return None
        if origin is not None and origin not in [f"http://{host}" for host in hosts]:
            return None
        _, token, *rest = [*path.split("/", 2), ""]
        if not hmac.compare_digest(token.encode(errors="replace"), self.token.encode()):
            return None
        return rest[0]
