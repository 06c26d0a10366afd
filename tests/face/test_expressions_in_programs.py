"""Expressions in a program: in mappings, changed, swapped, swept, drawn."""

import pickle

import pytest

import cosim
from cosim.errors import CosimError, ExpressionError, WrongType

HEAD = {"run": {"stop": 1, "step": 0.1}, "metrics": {"y": {"signal": "law.y", "reduce": "final"}}}


def made(expression="k*(r - x)", **more):
    law = {"expression": expression, "parameters": {"k": 4}, "inputs": {"r": 1, "x": 0.5}, **more}
    return cosim.diagram({**HEAD, "blocks": {"law": law}})


def worth(diagram):
    return diagram.run().metrics["y"]


def test_a_diagram_of_a_program_is_changed_swapped_and_kept():
    diagram = made()
    assert worth(diagram) == 2.0
    assert worth(diagram.set({"blocks.law.k": 5})) == 2.5
    assert worth(diagram.set({"blocks.law.expression": "k*r - x"})) == 3.5
    assert worth(diagram.swap(law="k*r + x")) == 4.5
    other = diagram.swap(law={"y": "e*k", "e": "r - x + 1"})
    assert worth(other) == 6.0 and worth(pickle.loads(pickle.dumps(other))) == 6.0  # noqa: S301  # of our own
    assert "expression: {y: e*k, e: r - x + 1}" in other.yaml


def test_a_list_of_runs_and_a_drawing():
    table = made().sweep([{"blocks.law.expression": "k*r - x"}, {"blocks.law.parameters.k": 6}])
    assert [float(y) for y in table.dataset["y"]] == [3.5, 3.0]
    svg = made("k*(r - x) + 0*time").draw().svg
    assert "y = k*(r - x) + 0*time" in svg


@pytest.mark.parametrize(
    ("expression", "kind", "place", "said"),
    [
        ("k*(r - x) + z", ExpressionError, "blocks.law.expression", "`z` is neither an input nor a parameter"),
        ({"y": "k*(r - x)", "q": "z"}, ExpressionError, "blocks.law.expression.q", "`z` is neither"),
        ({"y": "k*(r - x)", "q": 3}, WrongType, "blocks.law.expression.q", "must be text, not `3`"),
    ],
)
def test_a_mistake_names_the_path_of_keys(expression, kind, place, said):
    with pytest.raises(CosimError) as caught:
        made(expression).check()
    (error,) = getattr(caught.value, "errors", [caught.value])
    assert type(error) is kind and str(error.position) == place and said in error.message
