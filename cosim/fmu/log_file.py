"""The file to which the instances of a block log: a line for each message, as it comes.

A run begins a new file, so that runs at the same time do not mix: the name is that of the last one that began.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

from cosim.errors import FmuError
from cosim.fmu.trace import FmuTrace
from cosim.language.source import Node

_HEADING = "# messages of "


def attach(component: Any, node: Node, traces: Iterable[FmuTrace]) -> None:
    """Have the instances of a component log to the file that a node names. Raises: FmuError if it cannot be written."""
    file = _begun(component, node)
    for trace in traces:
        trace.log_to(file)


def _begun(component: Any, node: Node) -> BinaryIO:
    path = Path(node.value)
    try:
        if path.exists() and not _is_ours(path):
            message = f"block {component.name}: `{path}` is no log of messages, and would be lost"
            raise FmuError(message, node.position, "choose another `log_file`")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.unlink(missing_ok=True)
        file = os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666), "wb", buffering=0)
        file.write(f"{_HEADING}{component.name} ({component.entry.path.name})\n".encode())
    except OSError as error:
        message = f"block {component.name}: the log file `{path}` cannot be written: {error.strerror}"
        raise FmuError(message, node.position, "choose another `log_file`") from None
    return file


def _is_ours(path: Path) -> bool:
    """Whether what is to be replaced is empty, or such a log."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(_HEADING)) in (b"", _HEADING.encode())
