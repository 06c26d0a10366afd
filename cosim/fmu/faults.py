"""The exceptions that compiled functions raise, as texts that native code can log without Python.

numba puts a record of each exception (with constant arguments) into the code, a pickle inside; a kernel that raises
returns the record's address. Here a table from addresses to texts is added, and the pickles, which hold paths of the
author's machine, are blanked out.
"""

from __future__ import annotations

import pickle
import re

_PICKLE = re.compile(
    r'^@(?P<name>\.const\.pickledata\.[\w.]+) = internal constant \[(?P<size>\d+) x i8\] c"(?P<data>[^"]*)"$', re.M
)
_RECORD = re.compile(
    r"^@(?P<name>\.const\.picklebuf\.[\w.]+) = internal constant .*\{ ptr @(?P<data>\.const\.pickledata\.\w+),", re.M
)


def with_texts(ir: str, symbol: str) -> str:
    """LLVM IR with the table `symbol` of (record, text) pairs, ended by nulls; see `Fault` in wrapper/model.h."""
    pickles = {match["name"]: _bytes(match["data"]) for match in _PICKLE.finditer(ir)}
    constants, rows = [], []
    for k, record in enumerate(_RECORD.finditer(ir)):
        text = _text(pickles[record["data"]]).replace("#", "##").encode() + b"\0"
        encoded = "".join(f"\\{byte:02X}" for byte in text)
        constants.append(f'@{symbol}.{k} = internal constant [{len(text)} x i8] c"{encoded}"')
        rows.append(f"{{ ptr, ptr }} {{ ptr @{record['name']}, ptr @{symbol}.{k} }}")
    rows.append("{ ptr, ptr } zeroinitializer")
    table = f"@{symbol} = hidden constant [{len(rows)} x {{ ptr, ptr }}] [{', '.join(rows)}]"
    blank = _PICKLE.sub(r"@\g<name> = internal constant [\g<size> x i8] zeroinitializer", ir)
    return "\n".join([blank, *constants, table, ""])


def _bytes(data: str) -> bytes:
    """The bytes of an LLVM string: printable characters, and two hexadecimal digits behind a backslash."""
    return re.sub(rb"\\([0-9A-Fa-f]{2})", lambda match: bytes([int(match[1], 16)]), data.encode("latin-1"))


def _text(data: bytes) -> str:
    """An exception as Python shows it, such as "ValueError: too large". The pickle was made by this process."""
    kind, arguments, _ = pickle.loads(data)
    words = ", ".join(map(str, arguments or ()))
    return f"{kind.__name__}: {words}" if words else kind.__name__
