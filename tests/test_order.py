import pytest

from cosim import order
from cosim.errors import AlgebraicLoop, DiagramErrors

CHAIN = """
run: {stop: 1, step: 0.1}
blocks:
  last: {type: Gain, inputs: {u: middle.y}}
  middle: {type: Gain, inputs: {u: lag.y}}
  lag: {type: Lag, inputs: {u: source.y}}
  source: {type: Sine, parameters: {A: 1}}
"""


def test_outputs_come_after_what_they_read(wired):
    tasks = [f"{t.slave}.{t.function}" for t in order.evaluation_order(wired(CHAIN))]
    assert tasks.index("source.outputs") < tasks.index("lag.outputs") < tasks.index("middle.outputs")
    assert tasks.index("middle.outputs") < tasks.index("last.outputs")


def test_a_state_breaks_a_loop(wired):
    network = wired(
        """
        run: {stop: 1, step: 0.1}
        blocks:
          gain: {type: Gain, inputs: {u: integrator.x}, dimensions: {n: 1}}
          integrator: {type: Integrator, inputs: {u: gain.y}}
        """
    )
    assert [t.slave for t in order.evaluation_order(network)] == ["gain"]


def test_only_the_functions_that_derivatives_read_are_needed(wired):
    lag = wired(CHAIN).slaves["lag"]
    assert [f.name for f in order.needed_outputs(lag)] == ["outputs_mean"]


def test_every_algebraic_loop_is_named_port_by_port(wired):
    with pytest.raises(DiagramErrors) as caught:
        wired(
            """
            run: {stop: 1, step: 0.1}
            blocks:
              a: {type: Gain, inputs: {u: b.y}, dimensions: {n: 1}}
              b: {type: Gain, inputs: {u: a.y}}
              own: {type: Gain, inputs: {u: own.y}, dimensions: {n: 1}}
            """
        )
    loops = caught.value.errors
    assert all(isinstance(loop, AlgebraicLoop) and loop.position.line for loop in loops)
    texts = sorted(loop.message for loop in loops)
    assert texts == ["algebraic loop: a.y → b.y → a.y", "algebraic loop: own.y → own.y"]
