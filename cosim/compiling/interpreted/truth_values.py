"""The code of a function in which the truth of a comparison counts: an integer, as in kernels."""

from __future__ import annotations

import ast
import copy
import linecache
import types
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

from cosim.authoring.lowering.lowered_functions import TREES

#: What makes an integer of a truth value: under a name that no author can write.
TRUTH = "truth of kernels"


def counting(python: types.FunctionType) -> types.CodeType:
    """A function's code in which truth values count; its own code where its text cannot be read."""
    code = python.__code__
    if tree := TREES.get(code):  # which stands in no file
        judged = compile(_Counting().visit(copy.deepcopy(tree)), code.co_filename, "exec", dont_inherit=True)
        return next(_codes(judged))
    text = "".join(linecache.getlines(code.co_filename, python.__globals__))
    return next((judged for plain, judged in _module_codes(text, code.co_filename) if plain == code), code)


@lru_cache(maxsize=64)
def _module_codes(text: str, file: str) -> tuple[tuple[types.CodeType, types.CodeType], ...]:
    """The code of every function of a module, and the same in which truth values count."""
    try:
        plain = compile(text, file, "exec", dont_inherit=True)
        judged = compile(_Counting().visit(ast.parse(text)), file, "exec", dont_inherit=True)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ()
    return tuple(zip(_codes(plain), _codes(judged), strict=True))


def _codes(code: types.CodeType) -> Iterator[types.CodeType]:
    for inner in (c for c in code.co_consts if isinstance(c, types.CodeType)):
        yield inner
        yield from _codes(inner)


class _Counting(ast.NodeTransformer):
    """Makes an integer of what comparisons and `not` give; every line stays where it is."""

    def _judge(self, node: Any) -> Any:
        judged: Any = self.generic_visit(node)
        called = ast.Call(ast.Name(TRUTH, ast.Load()), [judged], [])
        return ast.fix_missing_locations(ast.copy_location(called, node))

    visit_Compare = _judge  # noqa: N815  # ast's name

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        return self._judge(node) if isinstance(node.op, ast.Not) else self.generic_visit(node)
