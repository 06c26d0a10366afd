"""The text of one function beside that of its whole file."""

import ast
import functools
import inspect
import linecache
import random
import textwrap

import numpy as np
import pytest

from cosim.authoring import author_source
from cosim.authoring.author_source import function_text

ODD = '''
def early(x):
    y = """
at the margin
"""
# a remark at the margin
    return y


def wide(
    a,
):
    return (
a
    )

class Home:
    @staticmethod
    def first(a): return a
    def second(b):

        def third(c):
            return c

        return third
    other = lambda d: d
'''


@pytest.mark.parametrize(
    "module", [ast, inspect, random, textwrap, np.lib._function_base_impl, np.linalg._linalg, author_source]
)
def test_a_function_by_itself_is_that_of_the_whole_file(module):
    """Places too; of Python's and numpy's functions, which many have written."""
    lines = linecache.getlines(module.__file__)
    for (name, first), node in author_source._functions(ast.parse("".join(lines))):
        (found,) = [f for key, f in author_source._definitions(lines, first).items() if key == (name, first)]
        assert ast.dump(found, include_attributes=True) == ast.dump(node, include_attributes=True)


def test_ends_that_lines_do_not_tell():
    scope = {"__name__": "odd"}
    linecache.cache["odd.py"] = len(ODD), None, ODD.splitlines(keepends=True), "odd.py"
    exec(compile(ODD, "odd.py", "exec"), scope)
    home = scope["Home"]
    functions = [scope["early"], scope["wide"], home.first, home.second, home.second(0)]
    whole = dict(author_source._functions(ast.parse(ODD)))
    for function in functions:
        text, code = function_text(function), function.__code__
        expected = whole[code.co_name, code.co_firstlineno]
        assert ast.dump(text.node, include_attributes=True) == ast.dump(expected, include_attributes=True)
        assert text.node is function_text(function).node
    assert function_text(home.other) is None and function_text(functools.partial(home.first)) is None
    linecache.cache["odd.py"] = 0, None, ["\n", *ODD.splitlines(keepends=True)], "odd.py"
    assert function_text(home.second) is None  # another text stands there now
    del linecache.cache["odd.py"]
