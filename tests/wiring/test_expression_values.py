"""What expressions compute: any is worth what Python's `math` says, alike in both engines."""

import contextlib
import itertools
import json
import math
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

from cosim.compiling.interpreted.functions import interpreted
from cosim.compiling.interpreted.libm import as_compiled
from cosim.engine import run
from cosim.errors import ExpressionError, Position
from cosim.language import elementary, expression
from cosim.language.entry import BlockEntry
from cosim.language.source import Node
from cosim.plain_math.definitions import FUNCTIONS
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


@given(trees())
@settings(max_examples=600, suppress_health_check=[HealthCheck.too_slow])
def test_all_members_at_once_have_the_bits_of_each(tree):
    """Or they are not computed at once."""
    said = text(tree).replace("time", "N")
    for name, stands_for in zip(NAMES, ("i", "(i - 20)/3", "N"), strict=True):
        said = re.sub(rf"\b{name}\b", stands_for, said)
    try:
        found = expression.of_members(said, 40)
    except ExpressionError:
        assume(False)
    assume(found is not None)
    each = [expression.evaluate(said, {"i": i, "N": 40.0}) for i in np.arange(1.0, 41.0)]
    assert found.tobytes() == np.array(each).tobytes(), said


@pytest.mark.parametrize("operation", ["i % N", "i // N", "(20 - i) % N", "(i - 20) // -N", "-i % 0.3", "i // 0.1"])
def test_remainders_of_all_members_at_once_are_python_s(operation):
    found = expression.of_members(operation, 4000)
    each = [expression.evaluate(operation, {"i": float(i), "N": 4000.0}) for i in range(1, 4001)]
    assert found.tobytes() == np.array(each).tobytes()


@pytest.mark.parametrize(
    "said", ["1/(i - 7)", "log(i - 7)", "(7 - i)**0.5", "exp(100*i)", "sqrt(7 - i)", "0/(i // 99 - 0)"]
)
def test_what_a_member_has_no_value_of_is_not_computed_at_once(said):
    assert expression.of_members(said, 20) is None


@pytest.mark.parametrize("name", ["sin", "cos", "exp", "log", "tanh"])
def test_functions_in_values_have_the_bits_that_compiled_code_has(name):
    """The same on every system, for one number and for many; angles beyond what is reduced quickly among them."""
    numbers = np.concatenate([np.random.default_rng(1).uniform(0.0, 700.0, 400), [1e-300, 709.5]])
    numbers = np.concatenate([numbers, [8e5, 1e6, 1e22, 1e300]]) if name != "exp" else numbers
    compiled = np.array([as_compiled(name, 1)(x) for x in numbers.tolist()])
    assert expression.VALUES[name](numbers).tobytes() == compiled.tobytes()
    assert (
        np.array([expression.evaluate(f"{name}(x)", {"x": x}) for x in numbers.tolist()]).tobytes()
        == compiled.tobytes()
    )


def test_powers_in_values_have_the_bits_that_compiled_code_has():
    a, b = np.random.default_rng(2).uniform([[0.0], [-9.0]], [[50.0], [9.0]], (2, 500))
    compiled = np.array([as_compiled("pow", 2)(x, y) for x, y in zip(a.tolist(), b.tolist(), strict=True)])
    assert expression.VALUES["**"](a, b).tobytes() == compiled.tobytes()
    assert [expression.evaluate("10**3"), expression.evaluate("(-2)**3"), expression.evaluate("3**-1")] == [
        1e3,
        -8,
        1 / 3,
    ]


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


def test_every_function_that_is_plain_in_code_is_so_in_values():
    assert {*elementary.PLAIN, "pow"} == FUNCTIONS.keys()
