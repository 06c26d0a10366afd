"""The code of a function in which the truth of a comparison counts, an integer, and powers are those of kernels."""

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
#: What makes an exponent one that computes the power as kernels do.
EXPONENT = "exponent of kernels"


def counting(python: types.FunctionType) -> types.CodeType:
    """A function's code with truth values and powers of kernels; its own code where its text cannot be read."""
    code = python.__code__
    if tree := TREES.get(code):  # which stands in no file
        judged = compile(_Counting().visit(copy.deepcopy(tree)), code.co_filename, "exec", dont_inherit=True)
        return next(_codes(judged))
    text = "".join(linecache.getlines(code.co_filename, python.__globals__))
    return next((judged for plain, judged in _module_codes(text, code.co_filename) if plain == code), code)


@lru_cache(maxsize=64)
def _module_codes(text: str, file: str) -> tuple[tuple[types.CodeType, types.CodeType], ...]:
    """The code of every function of a module, and the same with truth values and powers of kernels."""
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
    """Makes an integer of what comparisons and `not` give, and exponents; every line stays where it is."""

    def _judge(self, node: Any) -> Any:
        return _through(TRUTH, self.generic_visit(node))

    visit_Compare = _judge  # noqa: N815  # ast's name

    def visit_UnaryOp(self, node: ast.UnaryOp) -> Any:
        return self._judge(node) if isinstance(node.op, ast.Not) else self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> Any:
        self.generic_visit(node)
        if isinstance(node.op, ast.Pow) and not _is_folded(node):
            node.right = _through(EXPONENT, node.right)
        return node

    def visit_AugAssign(self, node: ast.AugAssign) -> Any:
        self.generic_visit(node)
        if isinstance(node.op, ast.Pow):
            node.value = _through(EXPONENT, node.value)
        return node


def _through(name: str, value: Any) -> Any:
    called = ast.Call(ast.Name(name, ast.Load()), [value], [])
    return ast.fix_missing_locations(ast.copy_location(called, value))


def _is_folded(node: ast.BinOp) -> bool:
    """Whether Python itself computes an expression, as there are numbers only."""
    return all(
        isinstance(n, ast.Constant | ast.BinOp | ast.UnaryOp | ast.operator | ast.unaryop) for n in ast.walk(node)
    )
