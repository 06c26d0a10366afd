"""How the library's blocks are written: annotations by one rule, and the paper's numbers where its equations are."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.blocks import library_diagrams

FILES = sorted((Path(__file__).parents[2] / "blocks").glob("*.py"))
#: The files of the paper; the others are for any system, and `test_library.py` looks for their equations.
HELPERS = ("extended_kalman", "jacobian", "kalman_steps", "matrices")
#: What the paper's designs are compared with, each from a publication of its own, and what these are made of.
COMPARED = {
    *(
        "control_barrier",
        "half_planes",
        "levant_gains",
        "linear_observers",
        "proper_differentiator",
    ),
    *("nonlinear_extended_state_observer", "sliding_mode_observer", "super_twisting_observer", "velocity_obstacles"),
}
PAPERS = [path for path in FILES if path.stem not in {*library_diagrams.FILES, *HELPERS, *COMPARED}]
YEAR = re.compile(r"\b(19|20)\d\d\b")
#: An equation, or the place where the paper says it in words.
NUMBER = re.compile(r"\(\d+\)|Section [IV]+|Fig. \d|Lemma \d|Theorems? \d|Definition \d")


def functions(tree: ast.AST) -> Iterator[tuple[ast.FunctionDef, bool]]:
    """All functions of a file, and whether each is a block's own, which names variables."""
    blocks = {"Block", "Measure", "ExtendedKalmanFilter"}
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            yield node, False
        elif isinstance(node, ast.ClassDef):
            own = node.name in blocks or any(isinstance(b, ast.Name) and b.id in blocks for b in node.bases)
            blocks |= {node.name} if own else set()
            yield from ((member, own) for member in node.body if isinstance(member, ast.FunctionDef))


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_helpers_are_annotated_and_functions_of_a_block_bare(path):
    for function, of_block in functions(ast.parse(path.read_text(encoding="utf-8"))):
        arguments = [*function.args.args, *filter(None, (function.args.vararg, function.args.kwarg))]
        arguments = [a for a in arguments if a.arg != "self"]
        annotated = [a.annotation is not None for a in arguments] + [function.returns is not None]
        assert not any(annotated) if of_block else all(annotated), function.name


@pytest.mark.parametrize("path", PAPERS, ids=lambda path: path.stem)
def test_files_and_blocks_say_which_equations_they_are(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in (tree, *(n for n in tree.body if isinstance(n, ast.ClassDef))):
        assert NUMBER.search(ast.get_docstring(node) or ""), getattr(node, "name", path.name)


@pytest.mark.parametrize("path", [path for path in FILES if path.stem in COMPARED], ids=lambda path: path.stem)
def test_what_is_compared_with_the_paper_says_where_it_is_published(path):
    """In each block's docstring, or in the file's, of all."""
    text = path.read_text(encoding="utf-8")
    tree = ast.parse(text)
    classes = [ast.get_docstring(node) or "" for node in tree.body if isinstance(node, ast.ClassDef)]
    assert YEAR.search(text)
    assert YEAR.search(ast.get_docstring(tree) or "") or all(map(YEAR.search, classes))
