"""Inputs that jump late: what a sampled block gives arrives in the midst of a step, or exactly at its end.

A damped oscillator under sampled feedback is linear between two jumps, which the matrix exponential solves.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from cosim.engine import compilation, program, run
from cosim.engine.probes import Probes
from cosim.engine.simulation import Simulation
from cosim.errors import DiagramErrors, TooLarge
from cosim.wiring import clocks
from cosim.wiring.network import Signal

BLOCKS = '''
from cosim import Block, Input, Output, Parameter, State


class Plant(Block):
    """x'' = 40 u - 25 x - 2 x'"""

    u = Input()
    x = State(output=True)
    v = State(output=True)

    def derivatives(u, x, v, d_x, d_v):
        d_x[0] = v
        d_v[0] = 40.0 * u - 25.0 * x - 2.0 * v


class Law(Block):
    x = Input()
    v = Input()
    u = Output()
    n = Output(dtype=int)

    def outputs(x, v, u, n):
        u[0] = 1.0 - 0.4 * x - 0.05 * v
        n[0] = int(1000.0 * u[0])


class Gain(Block):
    u = Input()
    k = Parameter(default=1.0)
    y = Output()

    def outputs(u, k, y):
        y[0] = k * u


class Thousandths(Block):
    n = Input(dtype=int)
    y = Output()

    def outputs(n, y):
        y[0] = 0.001 * n


class Sum(Block):
    a = Input()
    b = Input()
    y = Output()

    def outputs(a, b, y):
        y[0] = a + b


class Lag(Block):
    """x' = -x"""

    x = State(output=True)

    def derivatives(x, d_x):
        d_x[0] = -x
'''
START, BEFORE = np.array([0.3, 0.0]), 0.5
PERIOD, STOP = 0.2, 2.0
RUN = f"run: {{stop: {STOP}, step: 0.05}}"
LOOP = f"""
  law: {{own:Law, period: {PERIOD}, inputs: {{x: plant.x, v: plant.v}}}}
  plant: {{own:Plant, start: {{x: {START[0]}, u: {BEFORE}}}, inputs: {{u: {{from: law.u, delay: 0.1}}}}}}
"""
DIAGRAM = f"{RUN}\nblocks:{LOOP}"
DIRECT = LOOP.replace(f", u: {BEFORE}}}", "}").replace("{from: law.u, delay: 0.1}", "last.y")
ORDERS = {"heun": 2, "ralston": 2, "bogacki-shampine": 3, "rk4": 4, "dormand-prince": 5, "rodas4": 4}
METHODS = ["joint", "jacobi", "gauss-seidel", "iterated"]


def law(z):
    return 1.0 - 0.4 * z[0] - 0.05 * z[1]


def whole(z):
    """The same in whole thousandths."""
    return 0.001 * int(1000.0 * law(z))


def exact(*ways, offset=0.0, control=law, flowing=None):
    """(x, v) at every multiple of the period.

    ways: of inputs that add up, how late and how many times the law is read, what there is before, and when that ends,
    which is after the delay unless it is given. flowing: the time from which on exp(flowing - t) is added.
    """
    z, t, inputs, sampled, found = START, 0.0, [before for _, _, before, *_ in ways], offset, []
    arriving = [(min((late, *first)), k, gain * control(z)) for k, (late, gain, _, *first) in enumerate(ways)]
    while len(found) <= STOP / PERIOD:
        while arriving and arriving[0][0] <= t:
            _, way, inputs[way] = arriving.pop(0)
        if sampled <= t:
            arriving += [(sampled + late, k, gain * control(z)) for k, (late, gain, *_) in enumerate(ways)]
            arriving.sort()
            sampled += PERIOD
        if len(found) * PERIOD <= t:
            found.append(z)
        following = min(sampled, len(found) * PERIOD, arriving[0][0] if arriving else math.inf)
        z = moved(z, sum(inputs), following - t, 0.0 if flowing is None or t < flowing else math.exp(flowing - t))
        t = following
    return np.array(found)


def moved(z, held, time, decaying=0.0):
    """(x, v) after a time in which one part of the input is held, and another decays as exp(-t)."""
    a = np.array([[0, 1, 0, 0], [-25, -2, 40, 40], [0, 0, 0, 0], [0, 0, 0, -1]])
    return (expm(a * time) @ [*z, held, decaying])[:2]


@pytest.fixture
def wired(tmp_path):
    (tmp_path / "own.py").write_text(BLOCKS)

    def wire(text, *settings):
        path = tmp_path / "d.yaml"
        path.write_text(text.replace("own:", "python: own.py:"))
        return run.load(path, settings)

    return wire


def course(network, *names, every=1, engine="native"):
    """Times, and signals at every so many ticks."""
    built = program.build(network, network.diagram.run.method)
    signals = tuple(Signal(*name.split(".")) for name in names)
    kernels = compilation.compile_program(built) if engine == "native" else None
    one = Simulation(built, kernels, [Probes(signals, every)])
    one.initialize()
    parts = [[samples.times.copy(), *(samples.values[s].copy() for s in signals)] for (samples,) in one.batches()]
    return [np.concatenate(column) for column in zip(*parts, strict=True)]


def states(network, engine="native"):
    """(x, v) at every multiple of the period."""
    every = network.schedule.ticks(clocks.exact(PERIOD))
    return np.stack(course(network, "plant.x", "plant.v", every=every, engine=engine)[1:], axis=1)


def error(network, truth):
    return float(np.abs(states(network) - truth).max())


def order(wired, text, truth, *settings, steps=(0.05, 0.025)):
    """The order to which the error goes down with the step."""
    one, other = (error(wired(text, f"run.step={h}", *settings), truth) for h in steps)
    return math.log2(one / other)


@pytest.mark.parametrize("delay", [0.1, 0.2, 0.45])
@pytest.mark.parametrize("integrator", ORDERS)
def test_a_jump_at_a_steps_end_takes_nothing_from_the_integrators_order(wired, integrator, delay):
    text, truth = DIAGRAM.replace("0.1", str(delay)), exact((delay, 1.0, BEFORE))
    settings = f"run.integrator={integrator}", "run.method=joint"
    assert order(wired, text, truth, *settings) == pytest.approx(ORDERS[integrator], abs=0.3)


@pytest.mark.parametrize("delay", [0.13, math.pi / 20, 0.2712345678901234])
@pytest.mark.parametrize("integrator", ORDERS)
def test_a_jump_within_a_step_ends_it(wired, integrator, delay):
    """The parts of a step are no multiples of each other, so that the error is no smooth function of the step."""
    text, truth = DIAGRAM.replace("0.1", repr(delay)), exact((delay, 1.0, BEFORE))
    settings = f"run.integrator={integrator}", "run.method=joint"
    assert order(wired, text, truth, *settings) > ORDERS[integrator] - 0.5
    assert error(wired(text, *settings), truth) < 2.0 * error(wired(DIAGRAM, *settings), exact((0.1, 1.0, BEFORE)))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("delay", [0.1, 0.13])
def test_methods_differ_in_nothing_where_all_that_is_exchanged_is_held(wired, method, delay):
    text = DIAGRAM.replace("0.1", str(delay))
    reference = states(wired(text, "run.integrator=rk4", "run.method=joint"))
    assert states(wired(text, "run.integrator=rk4", f"run.method={method}")) == pytest.approx(reference, abs=1e-13)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("how", ["integrator=dormand-prince", "integrator=rodas4", "tolerance=1e-6"])
def test_both_engines_give_the_same_bits(wired, method, how):
    settings = "run.integrator=dormand-prince", f"run.method={method}", f"run.{how}"
    network = wired(DIAGRAM.replace("0.1", "0.13"), *settings)
    assert states(network, "python").tobytes() == states(network, "native").tobytes()


@pytest.mark.parametrize("delay", [0.1, 0.13])
@pytest.mark.parametrize("integrator", ["heun", "bogacki-shampine", "dormand-prince", "rodas5p"])
def test_inner_steps_within_a_tolerance_meet_no_jump(wired, integrator, delay):
    """What is tolerated of a step adds up over 2 s, in which a disturbance decays with exp(-t) and is fed back."""
    text, truth = DIAGRAM.replace("0.1", str(delay)), exact((delay, 1.0, BEFORE))
    for tolerance in (1e-5, 1e-8):
        settings = f"run.integrator={integrator}", f"run.tolerance={tolerance}", "run.method=joint"
        assert error(wired(text, *settings), truth) < 200.0 * tolerance


@pytest.mark.parametrize("integrator", ["radau", "lsoda", "dop853"])
def test_scipys_methods_meet_no_jump(wired, integrator):
    text, truth = DIAGRAM.replace("0.1", "0.13"), exact((0.13, 1.0, BEFORE))
    settings = f"run.integrator={integrator}", "run.tolerance=1e-8", "run.method=joint"
    assert error(wired(text, *settings), truth) < 2e-6


@pytest.mark.parametrize("offset", [0.05, 0.07, 0.25])
@pytest.mark.parametrize("delay", [0.1, 0.13])
def test_samples_may_begin_later_than_the_run(wired, offset, delay):
    """Until then the law's output is that of time zero, which arrives after the delay."""
    text = DIAGRAM.replace("0.1", str(delay)).replace(f"period: {PERIOD}", f"period: {PERIOD}, offset: {offset}")
    truth = exact((delay, 1.0, BEFORE), offset=offset)
    assert error(wired(text, "run.integrator=dormand-prince"), truth) < 1e-4
    assert order(wired, text, truth, "run.integrator=dormand-prince") > 4.5


@pytest.mark.parametrize("method", METHODS)
def test_what_a_block_without_states_passes_on_is_held_too(wired, method):
    text = f"{DIAGRAM.replace('law.u', 'gain.y')}  gain: {{own:Gain, parameters: {{k: 0.5}}, inputs: {{u: law.u}}}}"
    settings = "run.integrator=dormand-prince", f"run.method={method}"
    assert order(wired, text, exact((0.1, 0.5, BEFORE)), *settings) == pytest.approx(5, abs=0.3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("extrapolation", [0, 2])
@pytest.mark.parametrize("delay", [0.1, 0.13])
def test_what_is_late_jumps_behind_blocks_without_states(wired, method, extrapolation, delay):
    """Where it does, inputs that are extrapolated begin anew."""
    late = f"  late: {{own:Gain, inputs: {{u: {{from: law.u, delay: {delay}}}}}, start: {{u: {BEFORE}}}}}"
    settings = "run.integrator=dormand-prince", f"run.method={method}"
    extrapolated = (
        [f"blocks.plant.inputs.u={{from: late.y, extrapolation: {extrapolation}}}"] if method != "joint" else []
    )
    text = f"{RUN}\nblocks:{DIRECT.replace('last.y', 'late.y')}{late}"
    truth = exact((delay, 1.0, BEFORE))
    assert error(wired(text, *settings, *extrapolated), truth) < 1e-4
    assert order(wired, text, truth, *settings, *extrapolated) > 4.5


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("one", "other"), [(0.1, 0.05), (0.1, 0.13), (0.13, 0.17)])
def test_delays_add_up(wired, method, one, other):
    """What is read late of a late wire that has no start value is what there was at time zero."""
    late = f"  late: {{own:Gain, inputs: {{u: {{from: law.u, delay: {other}}}}}}}"
    text = f"{DIAGRAM.replace('from: law.u, delay: 0.1', f'from: late.y, delay: {one}')}{late}"
    truth = exact((one + other, 1.0, BEFORE, one))
    settings = "run.integrator=dormand-prince", f"run.method={method}"
    assert error(wired(text, *settings), truth) < 1e-4
    assert order(wired, text, truth, *settings) > 4.5


@pytest.mark.parametrize("method", METHODS)
def test_a_source_may_be_read_late_in_several_ways(wired, method):
    text = f"""{RUN}
blocks:{DIRECT}
  last: {{own:Sum, inputs: {{a: {{from: law.u, delay: 0.45}}, b: once.y}}, start: {{a: 0.25}}}}
  once: {{own:Gain, parameters: {{k: 0.5}}, inputs: {{u: {{from: law.u, delay: 0.13}}}}, start: {{u: 0.5}}}}
"""
    truth = exact((0.45, 1.0, 0.25), (0.13, 0.5, 0.25))
    assert order(wired, text, truth, "run.integrator=dormand-prince", f"run.method={method}") > 4.5


@pytest.mark.parametrize("delay", [0.1, 0.13])
@pytest.mark.parametrize("integrator", ["heun", "dormand-prince"])
@pytest.mark.parametrize("method", METHODS)
def test_what_jumps_and_changes_in_between_is_late_on_a_line(wired, method, integrator, delay):
    """A line between two samples is of order 2, also where one of them is a jump."""
    text = f"""{RUN.replace("0.05", "0.025")}
blocks:{LOOP.replace("law.u", "sum.y").replace("0.1", str(delay))}
  sum: {{own:Sum, inputs: {{a: law.u, b: lag.x}}}}
  lag: {{own:Lag, start: {{x: 1}}}}
"""
    settings = f"run.integrator={integrator}", f"run.method={method}"
    truth = exact((delay, 1.0, BEFORE), flowing=delay)
    assert order(wired, text, truth, *settings, steps=(0.025, 0.0125)) == pytest.approx(2, abs=0.3)


@pytest.mark.parametrize("method", METHODS)
def test_whole_numbers_are_late_as_they_are(wired, method):
    read = "  last: {own:Thousandths, inputs: {n: {from: law.n, delay: 0.13}}, start: {n: 500}}"
    settings = "run.integrator=dormand-prince", f"run.method={method}"
    truth = exact((0.13, 1.0, BEFORE), control=whole)
    assert error(wired(f"{RUN}\nblocks:{DIRECT}{read}", *settings), truth) < 1e-4


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("delay", [0.1, 0.13])
def test_steps_that_an_event_cuts_are_done_anew_with_what_was_held(wired, method, delay):
    """Events at a jump, just before and just after, and in a step in which there is none."""
    times = delay, 0.2 + delay - 1e-7, 0.4 + delay + 1e-7, 0.613, 0.8
    events = "".join(f"  at{k}: {{block: Step, parameters: {{at: {at!r}}}}}\n" for k, at in enumerate(times))
    settings = "run.integrator=dormand-prince", f"run.method={method}"
    network = wired(f"{DIAGRAM.replace('0.1', str(delay))}{events}", *settings)
    assert error(network, exact((delay, 1.0, BEFORE))) < 1e-4
    assert states(network, "python").tobytes() == states(network, "native").tobytes()


def test_steps_of_any_size_end_where_something_jumps(wired):
    """The error of coupling chooses steps for two oscillators that hear of each other, the plant is read late."""
    text = f"""{RUN}
blocks:{LOOP.replace("0.1", "0.13")}
  lag: {{own:Plant, start: {{x: 1}}, inputs: {{u: other.x}}}}
  other: {{own:Plant, inputs: {{u: lag.x}}}}
"""
    settings = "run.integrator=dormand-prince", "run.coupling_tolerance=1e-2"
    assert error(wired(text, *settings), exact((0.13, 1.0, BEFORE))) < 1e-4


@pytest.mark.parametrize("method", ["jacobi", "gauss-seidel", "iterated"])
def test_lines_between_samples_of_what_is_late_keep_the_tolerance(wired, method):
    """x' = cos 4 (t - 0.25) from 0.25 s on: inputs that are off by the tolerance add up to twice it in 2 s."""
    text = """
run: {stop: 2, step: 0.1, integrator: rk4, inner_steps: 10, smallest_step: 1e-5}
blocks:
  wave: {block: SecondOrder, parameters: {omega: 4, zeta: 0}, start: {x: 1}, inputs: {u: 0}}
  x: {block: Integrator, inputs: {u: {from: wave.x, delay: 0.25}}, start: {u: 0}}
"""
    for tolerance in (1e-2, 1e-3, 1e-5):
        times, x = course(wired(text, f"run.method={method}", f"run.coupling_tolerance={tolerance}"), "x.x")
        assert np.abs(x - np.sin(4.0 * np.maximum(times - 0.25, 0.0)) / 4.0).max() < 2.0 * tolerance


@pytest.mark.parametrize("engine", ["native", "python"])
def test_all_that_is_read_late_is_kept_however_short_steps_become(wired, engine):
    """A delay of ten steps, each of which becomes some fifty; on a line between two samples."""
    text = """
run: {stop: 2, step: 0.05, integrator: rk4, coupling_tolerance: 1e-4, smallest_step: 1e-3}
blocks:
  one: {own:Plant, start: {x: 1}, inputs: {u: other.x}}
  other: {own:Plant, inputs: {u: one.x}}
  late: {own:Gain, inputs: {u: {from: one.x, delay: 0.5}}}
"""
    times, x, late = course(wired(text), "one.x", "late.y", engine=engine)
    assert len(times) > 1500
    assert late == pytest.approx(np.interp(times - 0.5, times, x), abs=1e-12)


def test_samples_that_do_not_fit_into_memory_are_refused(wired):
    text = DIAGRAM.replace("0.1", "1e8").replace(f"stop: {STOP}, step: 0.05", "stop: 1e9, step: 1e-3")
    said = r"block plant: the \d+ samples of `u`, which is read 1e\+08 s late, need .* of memory"
    with pytest.raises(DiagramErrors, match=said) as caught:
        wired(text)
    assert isinstance(caught.value.errors[0], TooLarge) and caught.value.errors[0].position.line
