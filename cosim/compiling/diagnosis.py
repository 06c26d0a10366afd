"""Why the compiler refuses an author's function: the line in the author's file, in the author's words."""

from __future__ import annotations

import ast
import linecache
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from cosim.authoring.author_source import place_of, shown
from cosim.errors import KernelError, Position

PLAIN = "or declare the class with `compiled=False`"
NEEDS_MEMORY = "which needs memory of its own"
LOOP = f"write a loop over the elements, such as y[q] = u[q] + w[q], {PLAIN}"

#: Patterns of numba's words: what they mean to an author, and what to write instead.
_MEANINGS = (
    (
        # The last is what numba says of `u += 1`.
        (
            r"Cannot modify read-?only|explicit output that is read-only|>>> i?\w*setitem\(readonly|>>> fill\(readonly"
            r"|array\.fill.*readonly|object has no attribute 'args'"
            r"|<ufunc '\w+'>\) found for signature:\s+>>> \w+\(.*readonly array\([^()]*\)\)"
        ),
        "writes to an input, a parameter or another array that it may only read",
        "write to a Local, or to what the function computes",
    ),
    (
        r"<class 'float'>\) found for signature:\s+>>> float\((Literal\[)?bool",
        "gives a truth value to float(), which takes numbers",
        "write 1.0 if a > b else 0.0",
    ),
    (
        r"an integer or a real number: `(?P<a>\w+)`",
        "uses `{a}`, which is an integer on one path and a real number on another",
        "make it real on both, with float(…), or 0.0 for 0",
    ),
    (
        r"an integer or a real number: ``",
        "uses a number that is an integer on one path and a real number on another",
        "make it real on both, with float(…), or 0.0 for 0",
    ),
    (
        r"`(?P<a>floor|ceil|trunc|round)` of an integer",
        "rounds an integer with {a}(), which compiled code makes a real number of first",
        "leave {a}() out",
    ),
    (
        r"`(?P<a>\w+)` of truth values",
        "gives truth values alone to `np.{a}`, which does not count with them",
        "make them numbers with int(…)",
    ),
    (
        r"`~` of a truth value",
        "inverts a truth value with `~`, which makes -1 or -2 of it in Python",
        "write `not`",
    ),
    (
        r">>> [gs]etitem\((?:readonly )?array\([^()]*\), bool",
        "takes an element at an index that is a truth value",
        "make it a number with int(…)",
    ),
    (
        r">>> setitem\(array\([^()]*\), .*?, complex",
        "puts a complex number where a real one has its place",
        "take such powers of positive numbers only",
    ),
    (
        r"reflected (?P<b>list|set)\(.*?assigned to variable '(?P<a>\w+)' in globals",
        "uses the {b} `{a}` of the module, and compiled code knows constants only",
        "make it a tuple, with ( ) around its elements",
    ),
    (
        r">>> getitem\((?P<a>int\d+|float\d+|bool\w*), ",
        "takes an element of a number",
        "leave the index out, or declare the variable with a shape",
    ),
    (
        r"cannot index (?:readonly )?array\(\w+, (?P<a>\d)d.*?with (?P<b>\d) indices",
        "gives {b} indices to an array of {a} axes",
        "give one index for each axis",
    ),
    (
        r"Unsupported array index type float",
        "takes an element at an index that is no whole number",
        "make it one with int(…)",
    ),
    (
        r">>> setitem\(array\(.*?\), .*?, (?:readonly )?array\(",
        "puts an array where one number has its place",
        "write one element, such as y[q] = u[q]",
    ),
    (
        r"built-in function (?P<a>\w+)>\) found for signature:\s+>>> \w+\((?:readonly )?array\(",
        "gives an array to `{a}`, which takes numbers",
        LOOP,
    ),
    (
        r"Unknown attribute '(?P<a>\w+)' of type (int|float|bool)",
        "asks a number for `.{a}`, which numbers do not have",
        "declare the variable with a shape, or leave it out",
    ),
    (
        r"Unknown attribute '(?P<a>\w+)' of type (readonly )?array",
        "asks an array for `.{a}`, which arrays do not have in compiled code",
        f"write it with loops and `math`, {PLAIN}",
    ),
    (
        r"a real number is put into an array of \w+",
        "puts a real number where a whole number or a truth value has its place",
        "write int(…), or declare the variable without dtype",
    ),
    (
        r"Unknown attribute '(?P<a>\w+)' of type Module\(<module '(?!math'|numpy)(?P<b>[\w.]+)'",
        "calls `{b}.{a}` by its module, which compiled code cannot follow",
        "write `from {b} import {a}` at the top of the file",
    ),
    (
        r"Unknown attribute '(?P<a>\w+)' of type Module\(<module '(?P<b>[\w.]+)'",
        "uses `{b}.{a}`, which compiled code does not have",
        f"write it with loops and `math`, {PLAIN}",
    ),
    (
        r"Cannot unify (?P<a>.+?) and (?P<b>.+?) for",
        "gives one name values of two kinds: {a} and {b}",
        "use a name for each kind",
    ),
    (
        r"Untyped global name '(?P<a>\w+)'.*?<class '(?P<b>[\w.]+)'>",
        "uses `{a}` of the module, which is of type `{b}`; compiled code knows numbers, tuples, arrays and functions",
        f"make it a number, a tuple or an array, {PLAIN}",
    ),
    (
        r"Cannot bind '.*?to signature '(?P<a>.*?)'",
        "calls a function of {a} with other arguments",
        "give one value for each argument",
    ),
    (r"Invalid use of getiter with parameters \((int|float)", "loops over a number", "write range(…) around it"),
)
_TYPES = (
    (r"(?:readonly )?array\(\w+, (\d)d, \w+\)", r"an array of \1 axes"),
    (r"\b(Uni)?Tuple\(.*", "a tuple"),
    (r"\b(float|int|uint)\d+\b", "a number"),
    (r"Literal\[int\]\((-?\d+)\)", r"\1"),
    (r"\bbool(ean)?\b", "a truth value"),
)


#: How lines begin that tell where numba was, not what is wrong.
_DEBRIS = ("Failed in", "During:", "File ", "def ", "<numba.", "<source")


def explained(error: Exception, who: str, place: str) -> KernelError:
    """What the compiler says of a function, at the innermost line of an author's that it names.

    who: the function, in words; place: file:line where it begins.
    """
    text = str(error)
    places = re.findall(r'^File "(?!<)(.*)", line (\d+)', text, re.MULTILINE)
    own = [(str(Path(file).resolve()), int(line)) for file, line in places if not _is_numbas(file)]
    file, _, first = place.rpartition(":")
    file, line = own[0] if own else (file, int(first or 0))
    line = _line_of_statement(text, file, line)
    if "its result is a new array" in text:  # which `cosim.compiling.arithmetic` says
        return _allocation(who, file, line)
    for pattern, what, fix in _MEANINGS:
        if match := re.search(pattern, text, re.DOTALL if "global" in pattern else 0):
            groups = {k: _words(v) for k, v in match.groupdict().items()}
            return KernelError(f"{who} {what.format(**groups)}", _position(file, line, None), fix.format(**groups))
    said = [s.strip() for s in text.splitlines() if s.strip() and not s.startswith(_DEBRIS)]
    what = f"cannot be compiled: {' '.join(said[:2]) if said else type(error).__name__}"
    return KernelError(f"{who} {what}", _position(file, line, None), f"write it with loops and `math`, {PLAIN}")


def _line_of_statement(text: str, file: str, line: int) -> int:
    """The line that numba marks, which its text names before it shows the file."""
    during = re.search(r"^During: typing of .* at (\S.*) \((\d+)\)$", text, re.MULTILINE)
    return int(during[2]) if during and Path(during[1]).resolve() == Path(file) else line


def _words(kind: str) -> str:
    for pattern, word in _TYPES:
        kind = re.sub(pattern, word, kind)
    return kind


def _is_numbas(file: str) -> bool:
    return "/numba/" in Path(file).as_posix()


def _allocation(who: str, file: str, line: int) -> KernelError:
    """What is said of a line that makes an array."""
    node = _culprit(file, line)
    if isinstance(node, ast.Call):
        what = f"calls `{ast.unparse(node.func)}`, {NEEDS_MEMORY}"
        fix = f"write it as a loop, or declare work space as a Local, {PLAIN}"
    elif node is not None:
        what, fix = f"computes with whole arrays in `{_short(node)}`, {NEEDS_MEMORY}", LOOP
    else:
        what, fix = f"has an expression here, {NEEDS_MEMORY}", LOOP
    return KernelError(f"{who} {what}", _position(file, line, node), fix)


def _culprit(file: str, line: int) -> Any:
    """The call or the arithmetic of a statement that is most likely to make an array."""
    calls, operations = [], []
    for node in _nodes(file):
        if getattr(node, "lineno", 0) == line:
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                calls.append(node)
            elif isinstance(node, ast.BinOp | ast.UnaryOp | ast.Compare):
                operations.append(node)
    found = calls or operations
    return min(found, key=lambda n: n.col_offset, default=None)


def _short(node: Any) -> str:
    text = ast.unparse(node)
    return text if len(text) <= 40 else f"{text[:39]}…"


def _nodes(file: str) -> Iterable[Any]:
    try:
        return ast.walk(ast.parse("".join(linecache.getlines(file))))
    except (SyntaxError, ValueError):
        return ()


def _position(file: str, line: int, node: Any) -> Position:
    if node is not None:
        return place_of(file, node)
    text = linecache.getline(file, line)
    return Position(shown(file), line, len(text) - len(text.lstrip()) + 1 if line else 0)
