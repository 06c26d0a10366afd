"""Expressions in a run: closed forms, clocks, algebraic loops, domains, and what is compiled."""

import math

import numpy as np
import pytest

from cosim.engine import compilation, program, run, run_key
from cosim.wiring.network import Component

SPRING = """\
run: {{stop: 2, step: 0.01, method: joint, integrator: rk4}}
blocks:
  spring:
    expression: "{}"
    parameters: {{k: 40, d: 2}}
    inputs: {{x: cart.x, v: speed.x, x_ref: 0.5}}
  speed: {{block: Integrator, inputs: {{u: spring.y}}}}
  cart: {{block: Integrator, inputs: {{u: speed.x}}}}
record: {{signals: [cart.x, spring.y]}}
"""
LAW = "k*(x_ref - x) - d*v"
ENGINES = ["native", "python"]


def load(tmp_path, text, *settings, **more):
    path = tmp_path / "d.yaml"
    path.write_text(text, encoding="utf-8")
    return run.load(path, settings, **more)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_damped_oscillator_moves_as_its_closed_form(tmp_path, trajectories, engine):
    """To the error of rk4, which falls with the fourth power of the step."""
    network = load(tmp_path, SPRING.format(LAW))
    found = trajectories(network, "cart.x", "spring.y", engine=engine)
    t = np.arange(201) * 0.01
    omega = math.sqrt(40.0 - 1.0)
    moved = 0.5 * (1.0 - np.exp(-t) * (np.cos(omega * t) + np.sin(omega * t) / omega))
    error = np.abs(found["cart.x"] - moved).max()
    half = load(tmp_path, SPRING.format(LAW), "run.step=0.005")
    finer = np.abs(trajectories(half, "cart.x", engine=engine)["cart.x"][::2] - moved).max()
    assert error < 1e-6 and 14.0 < error / finer < 18.0


def test_both_engines_and_an_author_give_the_same_bits(tmp_path, trajectories):
    (tmp_path / "own.py").write_text(
        "from cosim import Block, Input, Output, Parameter\n\n\nclass Law(Block):\n    x = Input()\n    v = Input()\n"
        "    x_ref = Input()\n    k = Parameter()\n    d = Parameter()\n    y = Output()\n\n"
        "    def outputs(x, v, x_ref, k, d, y):\n        y[0] = k * (x_ref - x) - d * v**3 + x**2 / k\n"
    )
    network = load(tmp_path, SPRING.format("k*(x_ref - x) - d*v**3 + x**2/k"))
    own = load(tmp_path, SPRING.format(LAW).replace(f'expression: "{LAW}"', "python: own.py:Law"))
    native, python, author = (
        trajectories(n, "cart.x", "spring.y", engine=e)
        for n, e in ((network, "native"), (network, "python"), (own, "native"))
    )
    for signal in native:
        assert native[signal].tobytes() == python[signal].tobytes() == author[signal].tobytes()


# ---- when


@pytest.mark.parametrize("engine", ENGINES)
def test_sampled_and_held_between(tmp_path, trajectories, engine):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  s: {expression: '10*time'}\n"
    text += "  e: {expression: 'time + x', period: 0.3, offset: 0.2, inputs: {x: s.y}}\n"
    found = trajectories(load(tmp_path, text), "e.y", engine=engine)["e.y"]
    points = 0.1 * np.array([0, 0, 2, 2, 2, 5, 5, 5, 8, 8, 8])
    first = 2  # before its first sample, an output is what it is at the beginning
    np.testing.assert_allclose(found[first:], 11.0 * points[first:], rtol=1e-14)


# ---- algebraic loops


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("text", "root"),
    [
        ("'cos(x)', inputs: {x: e.y}", 0.7390851332151607),
        ("'(x + 2/x)/2', inputs: {x: e.y}, start: {y: 1}", math.sqrt(2.0)),
        ("'if(x > 0, sqrt(1 - x), 1)', inputs: {x: e.y}, start: {y: 0.5}", (math.sqrt(5.0) - 1.0) / 2.0),
        ("'exp(-x) + 0*k', parameters: {k: [1, 2]}, inputs: {x: e.y}", [0.5671432904097838] * 2),
    ],
)
def test_one_that_reads_itself_is_solved(tmp_path, trajectories, text, root, engine):
    """To rounding, of each unknown by its own size: see `cosim.master.newton`."""
    network = load(tmp_path, f"run: {{stop: 0.2, step: 0.1}}\nblocks:\n  e: {{expression: {text}}}\n")
    found = trajectories(network, "e.y", engine=engine)["e.y"]
    np.testing.assert_allclose(found, np.broadcast_to(root, found.shape), rtol=1e-14)


def test_one_output_feeds_through_and_another_does_not(tmp_path):
    """So there is no loop where only names tell so."""
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  e: {expression: {p: '2*time', q: 'u + p'}, inputs: {u: g.y}}\n"
    network = load(tmp_path, text + "  g: {block: Gain, inputs: {u: e.p}}\n")
    assert [str(task) for task in network.evaluation if hasattr(task, "torn")] == []
    network = load(tmp_path, text + "  g: {block: Gain, inputs: {u: e.q}}\n")
    assert [loop.torn[0].component in ("e", "g") for loop in network.evaluation if hasattr(loop, "torn")] == [True]


# ---- domains

DOMAINS = [
    ("sqrt(0.55 - time)", "`y` is not finite (nan) at t = 0.6 s"),
    ("1/(time - 0.5)", "`y` is not finite (inf) at t = 0.5 s"),
    ("log(0.55 - time)", "`y` is not finite (nan) at t = 0.6 s"),
    ("(0.55 - time)**0.5", "`y` is not finite (nan) at t = 0.6 s"),
    ("time % (time - time)", "`y` is not finite (nan) at t = 0 s"),
    ("max(0, sqrt(0.55 - time))", "`y` is not finite (nan) at t = 0.6 s"),
    ("min(sqrt(0.55 - time), 0)", "`y` is not finite (nan) at t = 0.6 s"),
    ("if(sqrt(0.55 - time) > 0, 1, 2)", "`y` is not finite (nan) at t = 0.6 s"),
    ("sign(asin(time + 0.75))", "`y` is not finite (nan) at t = 0.3 s"),
    ("floor(acosh(1.45 - time))", "`y` is not finite (nan) at t = 0.5 s"),
    ("exp(1000*time)", "`y` is 1.94e+130, beyond 9e+99 at t = 0.3 s"),
    ("sqrt(0.55 - time) > 0", "`y` compares what is no number at t = 0.6 s"),
    ("not (time > 1 or 0 == log(0.55 - time))", "`y` compares what is no number at t = 0.6 s"),
]


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("text", "said"), DOMAINS, ids=[row[0] for row in DOMAINS])
def test_what_has_no_value_ends_the_run_at_its_place(tmp_path, text, said, engine):
    outputs = f"'{text}'"
    network = load(tmp_path, f"run: {{stop: 1, step: 0.1}}\nblocks:\n  e: {{expression: {outputs}}}\n")
    outcome = run.Run(network, engine=engine).execute()
    error = outcome.error
    assert outcome.status in ("diverged", "failed") and error.message == f"block e: output {said}"
    assert (error.position.line, error.position.column) == (3, 19) and "sqrt(max(x, 0))" in error.fix


def test_which_member_and_which_output(tmp_path):
    text = "run: {stop: 1, step: 0.1}\nfleets: {f: 3}\nblocks:\n  e: {expression: {a: '1', b: 'sqrt(2.5 - i - time)'}, "
    network = load(tmp_path, text + "per: f, parameters: {i: i}}\n")
    error = run.Run(network).execute().error
    assert error.message == "block e: output `b` of f 3 is not finite (nan) at t = 0 s"
    assert (error.position.line, error.position.column) == (4, 31)


# ---- what is compiled, and known by its content


def compiled(network, name="spring"):
    return compilation.compile_program(program.build(network, network.diagram.run.method)).modules[name]


def test_the_same_expression_is_compiled_once_whatever_its_numbers(tmp_path, new_cache):
    text = SPRING.format("k*(x_ref - x) - d*v*0.125")
    assert compiled(load(tmp_path, text)).compiled_now
    same = [
        load(tmp_path, text, "blocks.spring.parameters.k=17"),
        load(tmp_path, text, "blocks.spring.inputs.x_ref=0.7", "run.step=0.001"),
        load(tmp_path, text.replace("spring", "law")),
        load(tmp_path, text.replace("k*(x_ref", "k * ( x_ref")),
        load(tmp_path, text, "blocks.spring.inputs.x=speed.x"),
    ]
    names = ["spring", "spring", "law", "spring", "spring"]
    assert not any(compiled(n, name).compiled_now for n, name in zip(same, names, strict=True))
    assert compiled(load(tmp_path, text.replace("0.125", "0.25"))).compiled_now


def test_two_blocks_of_one_expression_share_their_code(tmp_path):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  p: {expression: 'k*x', parameters: {k: 2}, inputs: {x: 1}}\n"
    network = load(tmp_path, text + "  q: {expression: 'k * x', parameters: {k: 3}, inputs: {x: p.y}}\n")
    components: dict[str, Component] = network.components
    assert components["p"].declaration.functions[0].python is components["q"].declaration.functions[0].python


def key(network):
    built = program.build(network, network.diagram.run.method)
    kernels = compilation.compile_program(built)
    return run_key.key(run_key.structure(network, built, kernels), built, run_key.all_values(network))


def test_the_key_of_a_run_tells_expressions_apart_by_what_they_compute(tmp_path):
    text = SPRING.format(LAW)
    first = key(load(tmp_path, text))
    assert key(load(tmp_path, text.replace(LAW, "k * (x_ref-x) - d*v"))) == first
    others = [
        text.replace(LAW, "k*(x_ref - x) - d*x + 0*v"),
        text.replace("k: 40", "k: 41"),
        text.replace("0.5", "0.6"),
    ]
    assert len({first, *(key(load(tmp_path, other)) for other in others)}) == 4
