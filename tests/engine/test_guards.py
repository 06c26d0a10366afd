"""What the loop guards by itself: its buffers, what is published, its way back to the caller."""

from __future__ import annotations

import re
import subprocess
import sys
import time

import numpy as np
import pytest

from cosim.engine import compilation, program, run
from cosim.engine import probes as probing
from cosim.engine.probes import Probes
from cosim.engine.simulation import Simulation
from cosim.errors import DiagramErrors, Diverged, WrongValue
from cosim.master import tables
from cosim.wiring.network import Signal

FLEET = """
run: {stop: 0.5, step: 0.01}
fleets: {robot: 40}
blocks:
  source: {type: Sine, per: robot}
  lag: {type: Lag, per: robot, inputs: {u: source.y}, start: {x: [0.5, "i"]}}
  o: {type: Oscillator}
"""
PROBES = [
    Probes((Signal("lag", "x"), Signal("lag", "y"), Signal("source", "y"))),
    Probes((Signal("o", "x"),), every=3),
    Probes((Signal("lag", "large"), Signal("o", "v")), every=7),
]


def seen(built, kernels):
    """All samples of all groups."""
    one = Simulation(built, kernels, PROBES)
    one.initialize()
    parts = [[] for _ in PROBES]
    for batch in one.batches():
        for kept, samples in zip(parts, batch, strict=True):
            kept.append((samples.times.copy(), {s: v.copy() for s, v in samples.values.items()}))
    return [
        (np.concatenate([s for s, _ in kept]), {n: np.concatenate([v[n] for _, v in kept]) for n in kept[0][1]})
        for kept in parts
    ]


@pytest.mark.parametrize("engine_", ["native", "python"])
@pytest.mark.parametrize("words", [1, 245, 1000])
def test_rows_of_any_size_are_all_kept_whatever_the_buffers_hold(wired, monkeypatch, engine_, words):
    """A row of 241 words: buffers of less than one, of just one, and of four."""
    built = program.build(wired(FLEET), "jacobi")
    kernels = compilation.compile_program(built) if engine_ == "native" else None
    expected = seen(built, kernels)
    monkeypatch.setattr(probing, "BUFFER_BYTES", 8 * words)
    for (times, values), (all_times, all_values), probes in zip(seen(built, kernels), expected, PROBES, strict=True):
        assert times.tolist() == all_times.tolist() == [k * 0.01 for k in range(0, 51, probes.every)]
        for signal, array in values.items():
            assert array.tobytes() == all_values[signal].tobytes()


@pytest.mark.parametrize("engine_", ["native", "python"])
def test_the_loop_itself_stops_at_a_full_buffer(wired, engine_):
    """Asked for all steps at once, it does those that have room, and nothing behind the buffer changes."""
    built = program.build(wired(FLEET), "jacobi")
    one = Simulation(built, compilation.compile_program(built) if engine_ == "native" else None, PROBES)
    one.initialize()
    buffer, groups = one.buffers.arrays[0], one.buffers.groups
    width = len(buffer) // (groups[0, tables.CAPACITY] + 1)
    groups[0, tables.CAPACITY] = 5
    buffer[:] = -7
    one.control[tables.LAST], one.control[tables.FINAL] = one.ticks, 1
    assert one.host.run("run") == tables.OK
    assert one.done == 5 and groups[0, tables.FILLED] == 5 and one.control[tables.FINAL] == 1
    assert (buffer[6 * width :] == -7).all()  # behind columns of five rows and one more
    assert (buffer != -7).sum() == 5 * width


OWN = """
import math
from cosim import Block, Input, Local, Output, State

class Bad(Block):
    big = State(output=True, dtype="float32", start=1.0)
    x = State(output=True)
    y = Output(2)
    w = Local(3)
    far = Output(finite=False)

    def outputs(time, y, far):
        far[0] = math.inf
        y[0] = 0.0
        y[1] = VALUE if time > 0.045 else 1.0

    def outputs_work(time, w):
        for q in range(w.size):
            w[q] = 0.0
        w[2] = LOCAL if time > 0.045 else 1.0

    def derivatives(d_x):
        d_x[0] = 1.0

    def update(big, next_big):
        next_big[0] = big * GROWTH
"""
QUIET = {"VALUE": "1.0", "LOCAL": "1.0", "GROWTH": "1.0"}
CASES = {
    "not a number": ({"VALUE": "math.sqrt(-1.0)"}, r"output `y\[2\]` of robot 1 is not finite \(nan\) at t = 0.05 s"),
    "infinity": ({"VALUE": "-1.0 / (time - time)"}, r"output `y\[2\]` of robot 1 is not finite \(-inf\) at t = 0.05"),
    "huge": ({"VALUE": "1e100"}, r"output `y\[2\]` of robot 1 is 1e\+100, beyond 9e\+99 at t = 0.05 s"),
    "a local": ({"LOCAL": "math.nan"}, r"local `w\[3\]` of robot 1 is not finite \(nan\) at t = 0.05 s"),
    "a single": ({"GROWTH": "1e10"}, r"state `big` of robot 1 is not finite \(inf\) at t = 0.04 s"),
}


def own(tmp_path, text, **values):
    for name, value in {**QUIET, **values}.items():
        text = text.replace(name, value)
    (tmp_path / "own.py").write_text(text)
    path = tmp_path / "own.yaml"
    period = "period: 0.01, " if "def update" in text else ""
    blocks = f"blocks: {{bad: {{python: 'own.py:Bad', {period}per: robot}}}}"
    path.write_text(f"run: {{stop: 0.1, step: 0.01}}\nfleets: {{robot: 2}}\n{blocks}\n")
    return run.load(path)


@pytest.mark.parametrize("engine_", ["native", "python"])
@pytest.mark.parametrize("case", CASES)
def test_every_published_value_is_finite_or_the_run_has_diverged(tmp_path, case, engine_):
    values, words = CASES[case]
    outcome = run.Run(own(tmp_path, OWN, **values), engine_).execute()
    assert outcome.status == "diverged" and isinstance(outcome.error, Diverged)
    with pytest.raises(Diverged, match=f"block bad: {words}"):
        raise outcome.error
    assert outcome.error.position.line == 3


@pytest.mark.parametrize("value", ["9e99 * 0.97", "-8.7e99"])
def test_what_is_finite_and_what_may_be_infinite_goes_on(tmp_path, value):
    """2 ** 332 is 8.75e99."""
    outcome = run.Run(own(tmp_path, OWN, VALUE=value)).execute()
    assert outcome.status == "completed"


ENDLESS = """
from pathlib import Path
from cosim import Block, Output, State

class Mark(Block, compiled=False):
    y = Output()

    def outputs(time, y):
        y[0] = time
        if time > 0.025:
            Path(__file__).with_name("mark").touch()

class Bad(Block):
    x = State(output=True)

    def derivatives(time, x, d_x):
        d_x[0] = 1.0
        k = 0
        while time > 0.02 and k >= 0:
            k = (k + 1) % 1000
"""


@pytest.mark.parametrize("interrupted", [False, True])
def test_a_kernel_that_never_ends_hears_patience_and_ctrl_c(tmp_path, interrupted):
    own(tmp_path, ENDLESS)
    path = tmp_path / "own.yaml"
    path.write_text(path.read_text().replace("per: robot}}", "per: robot}, mark: {python: 'own.py:Mark'}}"))
    patience = "600" if interrupted else "0.5"
    words = ["run", str(tmp_path / "own.yaml"), "--set", f"run.patience={patience}", "-o", str(tmp_path / "own.nc")]
    command = [sys.executable, "-m", "cosim.terminal.cli", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        if interrupted:
            while not (tmp_path / "mark").exists() and process.poll() is None:
                time.sleep(0.05)  # until it is about to begin what never ends
            process.send_signal(2)
        output, errors = process.communicate(timeout=120)
    if interrupted:
        assert process.returncode == 130 and "interrupted by SIGINT after 3 steps" in output
    else:
        assert process.returncode == 1 and "Traceback" not in errors
        assert "block bad: no sign of life for 0.5 s in derivatives() at t = 0.03 s" in errors


def test_what_a_method_would_ignore_is_refused(wired):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  o: {type: Oscillator, inner_steps: 3}\n"
    assert wired(text).components["o"].integration.inner_steps == 3
    with pytest.raises(DiagramErrors, match=r"diagram.yaml:3:\d+: block o: `inner_steps` is ignored under `joint`"):
        wired(text, "run.method=joint")
    with pytest.raises(DiagramErrors) as caught:
        wired("run: {stop: 1, step: 0.1}\nblocks:\n  s: {type: Sine, integrator: rk4, parameters: {A: 1}}\n")
    assert [type(e) for e in caught.value.errors] == [WrongValue]


def test_a_closed_simulation_may_begin_anew(wired):
    built = program.build(wired("run: {stop: 1, step: 0.1}\nblocks:\n  o: {type: Oscillator}\n"), "jacobi")
    one = Simulation(built, compilation.compile_program(built))
    for start in (1.0, 2.0):
        one.arena[:] = built.arena
        built.signal(Signal("o", "x"), one.arena)[...] = start
        one.initialize()
        one.close()
        assert one.value(Signal("o", "x")) == start


@pytest.mark.parametrize("start", [".inf", "-.inf"])
def test_an_infinite_start_is_refused_at_its_line(wired, start):
    """At time zero some output of another block would be found to be infinite, and blamed."""
    with pytest.raises(DiagramErrors, match=f"block lag: state `x` starts as {start.replace('.', '')}") as caught:
        wired(FLEET.replace('[0.5, "i"]', f"[0.5, {start}]"))
    assert caught.value.errors[0].position.line == 6


UNWRITTEN = """
from cosim import Block, CalculatedParameter, Local, Output, Parameter, State

class Outputs(Block):
    y = Output("n")
    def outputs(time, y):
        for q in range(2):
            y[q] = time

class Derivatives(Block):
    x = State("n", start=1.0, output=True)
    def derivatives(x, d_x):
        for q in range(2):
            d_x[q] = -x[q]

class Calculate(Block):
    p = Parameter(default=2.0)
    c = CalculatedParameter("n")
    y = Output()
    def calculate(p, c):
        for q in range(2):
            c[q] = p
    def outputs(c, y):
        y[0] = c[0]

class Locals(Block):
    m = Local("n")
    y = Output()
    def outputs_m(time, m):
        for q in range(2):
            m[q] = time
    def outputs(m, y):
        y[0] = m[0]

class Narrow(Block):
    y = Output("n", dtype="float32")
    def outputs(time, y):
        for q in range(2):
            y[q] = time
"""


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("Outputs", r"outputs\(\) has not written `y\[3\]` of robot 1 at t = 0 s"),
        ("Derivatives", r"derivatives\(\) has not written `d_x\[3\]` of robot 1 at t = 0.1 s"),
        ("Calculate", r"calculate\(\) has not written `c\[3\]` of robot 1 at t = 0 s"),
        ("Locals", r"outputs_m\(\) has not written `m\[3\]` of robot 1 at t = 0 s"),
        ("Narrow", r"outputs\(\) has not written `y\[3\]` of robot 1 at t = 0 s"),
    ],
)
def test_what_a_function_leaves_out_is_no_zero(tmp_path, engine, name, said):
    """Sizes are known only when the diagram is wired."""
    (tmp_path / "own.py").write_text(UNWRITTEN)
    text = "run: {stop: 1, step: 0.1}\nfleets: {robot: 2}\nblocks:\n"
    text += f"  b: {{python: own.py:{name}, per: robot, dimensions: {{n: 3}}}}\n"
    (tmp_path / "d.yaml").write_text(text)
    outcome = run.Run(run.load(tmp_path / "d.yaml"), engine).execute()
    assert outcome.status == "failed" and re.search(f"block b: {said}", str(outcome.error))
    assert run.Run(run.load(tmp_path / "d.yaml", ["blocks.b.dimensions.n=2"]), engine).execute().status == "completed"


def test_work_space_may_stay_unwritten(tmp_path):
    """The message says how to declare it."""
    (tmp_path / "own.py").write_text(UNWRITTEN)
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  b: {python: own.py:Locals, dimensions: {n: 3}}\n"
    (tmp_path / "d.yaml").write_text(text)
    outcome = run.Run(run.load(tmp_path / "d.yaml")).execute()
    assert "if it is work space, declare it with finite=False" in outcome.error.fix
    (tmp_path / "own.py").write_text(UNWRITTEN.replace('Local("n")', 'Local("n", finite=False)'))
    assert run.Run(run.load(tmp_path / "d.yaml")).execute().status == "completed"


def test_an_infinite_output_at_the_start_is_not_blamed_on_derivatives_that_wait(tmp_path):
    """At time zero no derivative has been written yet, and none has to be."""
    (tmp_path / "own.py").write_text(INFINITE)
    (tmp_path / "d.yaml").write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  b: {python: own.py:Early}\n"
        "  after: {python: own.py:Late, inputs: {u: b.y}}\n"
    )
    for kind in ("native", "python"):
        outcome = run.Run(run.load(tmp_path / "d.yaml"), kind).execute()
        assert outcome.status == "diverged" and "block b: output `y` is not finite (inf)" in str(outcome.error)


INFINITE = """
from cosim import Block, Input, Output, State

class Early(Block):
    y = Output()
    def outputs(time, y):
        y[0] = 1.0 / time

class Late(Block):
    u = Input()
    x = State(output=True)
    def derivatives(u, x, d_x):
        d_x[0] = u - x
"""
