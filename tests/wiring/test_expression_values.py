"""What expressions compute: any is worth what Python's `math` says, alike in both engines."""

import contextlib
import itertools
import json
import math
import re

import numpy as np
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

from cosim.compiling.interpreted.functions import interpreted
from cosim.engine import run
from cosim.errors import ExpressionError, Position
from cosim.language.entry import BlockEntry
from cosim.language.source import Node
from cosim.wiring import expression_blocks
from tests.wiring.random_expressions import NAMES, text, trees, value

POINTS = [0.0, -0.0, 1.0, -1.0, 0.5, -2.5, 3.25, 40.0, 1e10]
HERE = Position("d.yaml", 1, 1)


def function_of(said, **more):
    """The function of a block's one output, as plain Python with the numbers of kernels, and what it reads."""
    used = set(NAMES) & set(re.findall(r"\w+", said))
    inputs = {name: Node(1.0, HERE, HERE) for name in used}
    entry = BlockEntry("b", "expression", Node(said, HERE, HERE), HERE, inputs=inputs, **more)
    (function,) = expression_blocks.block(entry).declaration.functions
    return interpreted(function.python), function.arguments


def computed(said, names):
    """An expression at one point."""
    python, arguments = function_of(said)
    result = np.full(1, 7.0)
    given_ = [np.float64(names["time"]) if a == "time" else np.array([names[a]]) for a in arguments[:-1]]
    with np.errstate(all="ignore"):
        python(*given_, result)
    return result[0]


@given(trees())
@settings(max_examples=600, suppress_health_check=[HealthCheck.too_slow])
def test_any_expression_is_worth_what_math_says(tree):
    said = text(tree)
    assume(len(said) <= 1000)
    for a, b, c in itertools.islice(itertools.product(POINTS, repeat=3), 0, None, 37):
        names = {"a": a, "b": b, "c": c, "time": 0.75}
        try:
            found = computed(said, names)
        except ExpressionError as error:  # of numbers alone, which is told before anything runs
            assert any(word in error.message for word in ("has no value", "is not a real number", "is too large"))
            assume(False)
        wanted = value(tree, names)
        assert found == wanted or (math.isnan(found) and math.isnan(wanted)), f"{said} for {names}: {found}, {wanted}"


MANY = 25
WIDE = list(itertools.islice(itertools.product([*POINTS, 7.0, -40.0], repeat=3), 0, None, 11))


@given(st.lists(trees(), min_size=MANY, max_size=MANY))
@settings(max_examples=2, phases=[Phase.generate], suppress_health_check=[*HealthCheck])
def test_both_engines_give_the_same_bits(tmp_path, trajectories, many):
    """Of many expressions at many points; where one has no value, it is computed, and not chosen."""
    outputs, parameters, wanted = {}, {}, []
    for k, tree in enumerate(many):
        with contextlib.suppress(ExpressionError):
            function_of(text(tree))
            worth = np.array([value(tree, {**dict(zip(NAMES, point, strict=True)), "time": 0.0}) for point in WIDE])
            has = np.isfinite(worth) & (np.abs(worth) < 1e99)
            outputs[f"y{k}"], parameters[f"has{k}"] = f"if(has{k}, {text(tree)}, 0)", has.tolist()
            wanted.append(np.where(has, worth, 0.0))
    used = {name for name in NAMES if re.search(rf"\b{name}\b", " ".join(outputs.values()))}
    inputs = {name: [point[NAMES.index(name)] for point in WIDE] for name in used}
    block = {"expression": outputs, "parameters": parameters, "inputs": inputs}
    (tmp_path / "d.yaml").write_text(json.dumps({"run": {"stop": 1, "step": 1}, "blocks": {"b": block}}))
    network = run.load(tmp_path / "d.yaml")
    names = [f"b.{output}" for output in outputs]
    native, python = (trajectories(network, *names, engine=engine) for engine in ("native", "python"))
    for name, expected in zip(names, wanted, strict=True):
        assert native[name].tobytes() == python[name].tobytes(), outputs[name[2:]]
        np.testing.assert_array_equal(native[name][0], expected, err_msg=outputs[name[2:]])
