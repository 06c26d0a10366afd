import pytest

from cosim import (
    Block,
    CalculatedParameter,
    Indicator,
    Input,
    Local,
    Measure,
    Output,
    Parameter,
    State,
    condition,
    rule,
)
from cosim.errors import DeclarationError
from tests.signal_blocks import Counter, Lag


def test_what_a_function_reads_and_writes_follows_from_its_signature():
    functions = {f.name: f for f in Lag.declaration.functions}
    assert functions["calculate"].writes == {"rate"}
    assert functions["outputs_mean"].writes == {"mean"}
    assert functions["outputs"].writes == {"y", "large"}
    assert functions["derivatives"].writes == {"d_x"}
    assert functions["derivatives"].reads == ("u", "x", "mean", "rate")
    assert Lag.declaration.writer("mean") is functions["outputs_mean"]
    assert Lag.declaration.writer("x") is None


def test_states_are_continuous_or_discrete_by_what_drives_them():
    assert [s.name for s in Lag.declaration.continuous()] == ["x"]
    assert [s.name for s in Counter.declaration.discrete()] == ["count", "held"]


def test_functions_can_be_called_alone():
    import numpy as np

    derivative = np.zeros(2)
    Lag.derivatives(np.array([1.0, 2.0]), np.array([0.5, 0.5]), 0.5, 2.0, derivative)
    assert derivative.tolist() == [0.5, 2.5]


def test_a_later_function_reads_what_an_earlier_one_writes():
    class Chain(Block):
        u = Input()
        a = Output()
        b = Output()

        def outputs_first(u, a):
            a[0] = u

        def outputs_second(a, b):
            b[0] = a

    assert [f.reads for f in Chain.declaration.functions] == [("u",), ("a",)]


def test_what_only_locals_come_of_may_be_a_local():
    class Knowing(Block):
        truth = Input()
        measured = Input()
        inner = Local()
        error = Local()
        y = Output()

        def outputs_inner(truth, inner):
            inner[0] = truth

        def outputs_error(inner, measured, error):
            error[0] = inner - measured

        def outputs(measured, y):
            y[0] = measured

    class Leaking(Knowing):
        def outputs(error, y):
            y[0] = error

    assert Knowing.declaration.feeds_locals_only("truth")
    assert not Knowing.declaration.feeds_locals_only("measured")
    assert not Leaking.declaration.feeds_locals_only("truth")


def test_a_subclass_inherits_and_overrides():
    class Faster(Lag):
        T = Parameter(default=0.1)

    assert Faster.declaration.variables["T"].start == 0.1
    assert len(Faster.declaration.functions) == len(Lag.declaration.functions)


def test_rules_and_measures():
    class Ruled(Measure):
        k = Parameter(default=1.0)

        @rule("k > 0", "a book")
        def positive(k):
            return k > 0

        @condition("k < 2", "Theorem 9")
        def small(k):
            return k < 2, f"k = {k}"

    first, second = Ruled.declaration.rules
    assert (first.arguments, first.warning, first.source) == (("k",), False, "a book")
    assert second.warning and second.function(3.0) == (False, "k = 3.0")
    assert Ruled.declaration.measuring and not Lag.declaration.measuring


def test_an_unknown_argument_is_named_with_the_nearest_variable():
    with pytest.raises(DeclarationError, match=r"names `velocity`") as caught:

        class Wrong(Block):
            velocities = Input()
            y = Output()

            def outputs(velocity, y):
                y[0] = velocity

    assert "`velocities`" in caught.value.fix


def test_what_is_integrated_is_finite():
    with pytest.raises(DeclarationError, match="state `x` has finite=False: what is integrated is finite") as caught:

        class Wrong(Block):
            x = State(finite=False)

            def derivatives(x, d_x):
                d_x[0] = -x

    assert caught.value.position.file.endswith("test_block.py") and "next_x" in caught.value.fix

    class Sampled(Block):
        x = State(finite=False)

        def update(x, next_x):
            next_x[0] = 1.0 / x

    assert not Sampled.declaration.mistakes


def test_what_is_held_jumps_where_an_indicator_says():
    with pytest.raises(DeclarationError, match="`side` is held, and no indicator says where it jumps") as caught:

        class Nowhere(Block):
            u = Input()
            side = Local(held=True)

            def outputs(u, side):
                side[0] = 1.0 if u > 0.0 else -1.0

    assert "declare an Indicator()" in caught.value.fix
    with pytest.raises(DeclarationError, match=r"outputs\(\) computes what is held, and what is not"):

        class Mixed(Block):
            u = Input()
            side = Local(held=True)
            zero = Indicator()
            y = Output()

            def outputs(u, side, y):
                side[0] = 1.0 if u > 0.0 else -1.0
                y[0] = u

            def indicators(u, zero):
                zero[0] = u


@pytest.mark.parametrize("kind", ["float32", "int64", "bool"])
def test_a_continuous_state_is_float64(kind):
    """Integrators add to what a state holds: a narrower one would lose their increments without a word."""
    with pytest.raises(DeclarationError, match=f"state `x` is {kind}: a continuous state is float64") as caught:

        class Narrow(Block):
            x = State(dtype=kind)

            def derivatives(x, d_x):
                d_x[0] = 1.0

    assert caught.value.position.file.endswith("test_block.py") and "next_x" in caught.value.fix

    class Sampled(Block):
        x = State(dtype=kind)

        def update(x, next_x):
            next_x[0] = x


def test_everything_declared_is_computed_once():
    with pytest.raises(DeclarationError, match="state `x` needs"):

        class NoDerivative(Block):
            x = State()

    with pytest.raises(DeclarationError, match="has derivatives and an update") as caught:

        class Both(Block):
            x = State()

            def derivatives(x, d_x):
                d_x[0] = x

            def update(x, next_x):
                next_x[0] = x

    assert "remove d_x from derivatives() or next_x from update()" in caught.value.fix
    with pytest.raises(DeclarationError, match="no outputs"):

        class NoOutput(Block):
            y = Output()

    with pytest.raises(DeclarationError, match="no calculate"):

        class NoCalculation(Block):
            p = CalculatedParameter()
