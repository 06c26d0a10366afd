"""How the library's blocks are written: annotations by one rule, and the paper's numbers where its equations are."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

FILES = sorted((Path(__file__).parents[2] / "blocks").glob("*.py"))
#: An equation, or the place where the paper says it in words.
NUMBER = re.compile(r"\(\d+\)|Section [IV]+|Fig. \d|Lemma \d|Theorems? \d|Definition \d")


def functions(tree: ast.AST) -> Iterator[tuple[ast.FunctionDef, bool]]:
    """All functions of a file, and whether each is a block's own, which names variables."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            yield node, False
        elif isinstance(node, ast.ClassDef):
            for member in node.body:
                if isinstance(member, ast.FunctionDef):
                    yield member, any(isinstance(b, ast.Name) and b.id in ("Block", "Measure") for b in node.bases)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_helpers_are_annotated_and_functions_of_a_block_bare(path):
    for function, of_block in functions(ast.parse(path.read_text(encoding="utf-8"))):
        arguments = [*function.args.args, *filter(None, (function.args.vararg, function.args.kwarg))]
        arguments = [a for a in arguments if a.arg != "self"]
        annotated = [a.annotation is not None for a in arguments] + [function.returns is not None]
        assert not any(annotated) if of_block else all(annotated), function.name


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_files_and_blocks_say_which_equations_they_are(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in (tree, *(n for n in tree.body if isinstance(n, ast.ClassDef))):
        assert NUMBER.search(ast.get_docstring(node) or ""), getattr(node, "name", path.name)
