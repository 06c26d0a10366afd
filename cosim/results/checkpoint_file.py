"""A checkpoint as a file: what a run was, and all that it knew, in arrays. At every instant there is a whole one.

    MAGIC | SHA-256 of all that follows | bytes of the header | header, as JSON | arrays, one after the other

The header has what is said of the run, and how the arrays nest in mappings and lists, each as its type and shape.
Nothing in a checkpoint is code, and one that is not byte for byte what was written is refused.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
from collections.abc import Mapping
from contextlib import suppress
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from cosim.errors import CheckpointError
from cosim.machine import files
from cosim.machine.interruption import GRACE

MAGIC = b"cosimCP1"
DIGEST_BYTES, LENGTH_BYTES = 32, 8
HEAD_BYTES = len(MAGIC) + DIGEST_BYTES + LENGTH_BYTES

#: Mappings and lists of such, and arrays of numbers.
Tree = Any


class CheckpointFile:
    """The checkpoint at a path. Whose run it is holds a lock on it, where the system has locks."""

    def __init__(self, path: Path) -> None:
        """Raises: ResultError where something stands that is no checkpoint."""
        self.path = path
        self._held: int | None = None
        files.refuse_foreign(path, "a checkpoint of a run", _is_checkpoint)

    def take(self) -> tuple[dict[str, Any], Tree]:
        """What is said of the run, and what it knew; it is now ours to go on from. Raises: CheckpointError."""
        try:
            with self.path.open("rb") as file:
                self._lock(file.fileno())
                content = file.read()
        except OSError as error:
            message = f"cannot read {self.path}: {error.strerror}"
            raise CheckpointError(message, fix="leave --resume out to begin anew") from None
        try:
            return decoded(content)
        except (ValueError, TypeError, KeyError, RecursionError):
            raise self.damaged() from None

    def claim(self) -> None:
        """Have the place for ourselves, whatever stands there. Raises: CheckpointError where its run is going on."""
        with suppress(FileNotFoundError), self.path.open("rb") as file:
            self._lock(file.fileno())

    def write(self, about: Mapping[str, Any], tree: Tree) -> None:
        """Put a new checkpoint in the place of the last one. Raises: OSError."""
        pieces = encoded(about, tree)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with files.fresh(self.path) as new, new.open("xb") as file:
            locked = _lock(file.fileno())
            for piece in pieces:
                file.write(piece)
            file.flush()
            os.fsync(file.fileno())
            held = os.dup(file.fileno()) if locked else None
        self.release()
        self._held = held

    def release(self) -> None:
        """Let another run go on from it."""
        if self._held is not None:
            os.close(self._held)
            self._held = None

    def remove(self) -> None:
        """The run needs no checkpoint any more, nor what a kill in the midst of writing one may have left."""
        with suppress(OSError):
            self.path.unlink(missing_ok=True)
            for left in files.unfinished(self.path):
                left.unlink(missing_ok=True)

    def damaged(self) -> CheckpointError:
        """The error for one that is not as it was written."""
        return CheckpointError(f"{self.path} is damaged", fix="leave --resume out to begin anew")

    def _lock(self, file: int) -> None:
        """Have the checkpoint for ourselves. Raises: CheckpointError where its run is still going on."""
        limit = time.monotonic() + GRACE  # in which the processes of a run that was killed end too
        while True:
            current = os.fstat(file).st_ino == self.path.stat().st_ino
            if current and (locked := _lock(file)) is not None:
                self._held = os.dup(file) if locked else None
                return
            if not current or time.monotonic() > limit:
                fix = "wait for it, or end it first"
                raise CheckpointError(f"the run whose checkpoint is {self.path} is still going on", fix=fix)
            time.sleep(0.02)


def _lock(file: int) -> bool | None:
    """Lock a file as long as it is open: None where somebody else has it, False where there are no locks."""
    try:
        import fcntl
    except ImportError:  # Windows, which does not replace files that are open either
        return False
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return None
    except OSError:  # a file system without locks
        return False
    return True


def _is_checkpoint(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


# ---- bytes ----


def encoded(about: Mapping[str, Any], tree: Tree) -> list[Any]:
    """The pieces of a checkpoint; about: what JSON has words for."""
    arrays: list[np.ndarray] = []
    header = json.dumps({"about": about, "tree": _outline(tree, arrays)}, allow_nan=False).encode()
    body: list[Any] = [
        len(header).to_bytes(LENGTH_BYTES, "little"),
        header,
        *(array.view(np.uint8) for array in arrays),
    ]
    digest = hashlib.sha256()
    for piece in body:
        digest.update(piece)
    return [MAGIC, digest.digest(), *body]


def decoded(content: bytes) -> tuple[dict[str, Any], Tree]:
    """What was said and known, of a checkpoint's bytes. Raises: ValueError, and what JSON raises."""
    digest = hashlib.sha256(content[len(MAGIC) + DIGEST_BYTES :]).digest()
    if content[: len(MAGIC) + DIGEST_BYTES] != MAGIC + digest:
        raise ValueError("not as it was written")
    length = int.from_bytes(content[HEAD_BYTES - LENGTH_BYTES : HEAD_BYTES], "little")
    header = json.loads(content[HEAD_BYTES : HEAD_BYTES + length])
    tree, end = _filled(header["tree"], content, HEAD_BYTES + length)
    if end != len(content):
        raise ValueError("more than it says")
    return header["about"], tree


def _outline(tree: Tree, arrays: list[np.ndarray]) -> Any:
    """How arrays nest, each as its type and shape; they are added to a list, in that order."""
    if isinstance(tree, Mapping):
        return {name: _outline(below, arrays) for name, below in tree.items()}
    if isinstance(tree, list):
        return [_outline(below, arrays) for below in tree]
    array = np.ascontiguousarray(tree)
    assert array.dtype.kind in "biuf", array.dtype
    arrays.append(array.reshape(-1))
    return " ".join((array.dtype.str[1:], *map(str, np.shape(tree))))


def _filled(outline: Any, content: bytes, at: int) -> tuple[Tree, int]:
    """The tree whose arrays begin at a byte, and where they end. Raises: ValueError."""
    if isinstance(outline, Mapping):
        found = {}
        for name, below in outline.items():
            found[name], at = _filled(below, content, at)
        return found, at
    if isinstance(outline, list):
        several = []
        for below in outline:
            tree, at = _filled(below, content, at)
            several.append(tree)
        return several, at
    if not re.fullmatch(r"[biuf][1248](?: \d{1,15})*", outline):
        raise ValueError(outline)
    kind, *shape = outline.split()
    sizes = tuple(map(int, shape))
    array = np.frombuffer(content, np.dtype(kind), prod(sizes), at).reshape(sizes).copy()
    return array, at + array.nbytes
