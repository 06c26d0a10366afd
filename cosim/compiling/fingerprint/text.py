"""A text that changes whenever a function could compute something else: its code and all that the code reaches.

What a function reads is found in its bytecode: each name of its globals, and through modules, which are only roads, the
attribute at the end (of ``a.b.SCALE`` the number). A value is followed to its ground: containers to their elements,
functions and jitted functions to their code, defaults and closures, classes to their members, objects to their state.
What an installed package or Python itself has is known by the package's version and files.

Where a road cannot be followed to its end (an open file, a C library's function pointer), no text would be right: the
one that is given then is unlike any other, so that nothing is ever found under it. Comments are not part of the text.
"""

from __future__ import annotations

import uuid
from typing import Any

from cosim.compiling.fingerprint.feed import Feed, NoEnd
from cosim.compiling.fingerprint.objects import ObjectFeed
from cosim.compiling.fingerprint.packages import Packages
from cosim.compiling.fingerprint.roads import Roads
from cosim.machine import installed

_ONCE = "once: "


def fingerprint(function: Any, interpreted: bool = False, lines: bool = False) -> str:
    """The text of a function (or any other value).

    lines: where the code stands counts too, for what tells it in messages. interpreted: the function runs as plain
    Python, so that what it calls may look at files, the clock and the like; a function of a package that is not known
    to look at its arguments only is then a road without an end.
    """
    home = installed.package(getattr(function, "__module__", None) or "")
    try:
        return _digest(function, home, interpreted, lines).hex()
    except (NoEnd, RecursionError) as found:
        reason = str(found) if isinstance(found, NoEnd) else "values that are nested too deep"
        return f"{_ONCE}{reason}\n{uuid.uuid4().hex}"


def obstacle(text: str) -> str:
    """What keeps a fingerprint, or a text that one is part of, from holding for longer than now; "" if nothing does."""
    return text.partition(_ONCE)[2].partition("\n")[0]


def _digest(value: Any, home: str, interpreted: bool, lines: bool) -> bytes:
    """home: the package whose own functions are followed even if it is installed. Raises: NoEnd."""
    feed = Feed(lambda alone: _digest(alone, home, interpreted, lines))
    packages = Packages(feed, home, interpreted)
    objects = ObjectFeed(feed, packages, Roads(feed, packages, interpreted, lines))
    feed.value(value)
    for reached in feed.reached:  # which grows meanwhile
        objects.follow(reached)
    return feed.digest()
