"""FMUs that other tools made: pythonfmu (FMI 2.0) and pythonfmu3 (FMI 3.0), alone, per robot, mixed, failing."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import numpy as np
import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.errors import FmuFailed
from cosim.fmu import inspect

LAG2 = """
from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String


class PythonLag2(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u, self.x, self.T, self.steps, self.high, self.label = 0.0, 0.0, 1.0, 0, False, "none"
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("x", causality=Fmi2Causality.output))
        self.register_variable(Integer("steps", causality=Fmi2Causality.output, variability=Fmi2Variability.discrete))
        self.register_variable(Boolean("high", causality=Fmi2Causality.output, variability=Fmi2Variability.discrete))
        self.register_variable(Real("T", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))
        self.register_variable(String("label", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))

    def do_step(self, time, step):
        if self.label == "broken" and time > 0.4955:
            raise RuntimeError("this one is broken")
        self.x += step * ((self.u - self.x) / self.T)
        self.steps += 1
        self.high = self.x > 0.5
        return self.label != "lazy"
"""
LAG3 = """
from pythonfmu3 import Boolean, Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64, Int64, String


class PythonLag3(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.u, self.x, self.T, self.steps, self.high, self.label = 0.0, 0.0, 0.0, 1.0, 0, False, "none"
        continuous, discrete = Fmi3Variability.continuous, Fmi3Variability.discrete
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        self.register_variable(Float64("u", causality=Fmi3Causality.input))
        self.register_variable(Float64("x", causality=Fmi3Causality.output))
        self.register_variable(Int64("steps", causality=Fmi3Causality.output, variability=discrete))
        self.register_variable(Boolean("high", causality=Fmi3Causality.output, variability=discrete))
        self.register_variable(Float64("T", causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable))
        self.register_variable(String("label", causality=Fmi3Causality.parameter, variability=Fmi3Variability.tunable))

    def do_step(self, time, step):
        if self.label == "broken" and time > 0.4955:
            raise RuntimeError("this one is broken")
        self.x += step * ((self.u - self.x) / self.T)
        self.steps += 1
        self.high = self.x > 0.5
        return self.label != "lazy"
"""
OSCILLATOR = """
from pythonfmu3 import Fmi3Causality, Fmi3Initial, Fmi3SlaveBase, Fmi3Variability, Float64, ModelExchange


class PythonOscillator(Fmi3SlaveBase, ModelExchange):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time, self.x, self.v, self.w, self.derx, self.derv = 0.0, 1.0, 0.0, 2.0, 0.0, 0.0
        continuous, exact = Fmi3Variability.continuous, Fmi3Initial.exact
        self.register_variable(Float64("time", causality=Fmi3Causality.independent, variability=continuous))
        for k, (name, causality) in enumerate((("x", Fmi3Causality.output), ("v", Fmi3Causality.local))):
            self.register_variable(Float64(name, causality=causality, variability=continuous, initial=exact))
            self.register_variable(
                Float64(f"der{name}", causality=Fmi3Causality.local, variability=continuous, derivative=2 * k + 1)
            )
        self.register_variable(Float64("w", causality=Fmi3Causality.parameter, variability=Fmi3Variability.fixed))

    def get_continuous_state_derivatives(self):
        self.derx, self.derv = self.v, -self.w * self.w * self.x
        return [self.derx, self.derv]
"""


@pytest.fixture(scope="session")
def others(tmp_path_factory):
    """The FMUs of these components by name."""
    folder = tmp_path_factory.mktemp("others")
    components = {"PythonLag2": LAG2, "PythonLag3": LAG3, "PythonOscillator": OSCILLATOR}
    for name, code in components.items():
        tool = "pythonfmu" if name.endswith("2") else "pythonfmu3"
        pytest.importorskip(tool)
        (folder / f"{name}.py").write_text(textwrap.dedent(code))
        command = [sys.executable, "-m", tool, "build", "-f", f"{name}.py", "-d", "."]
        subprocess.run(command, check=True, cwd=folder, capture_output=True)
    return {name: folder / f"{name}.fmu" for name in components}


@pytest.mark.parametrize("name", ["PythonLag2", "PythonLag3"])
@pytest.mark.parametrize(("engine", "isolated"), [("native", "false"), ("python", "false"), ("native", "true")])
def test_it_runs_for_each_robot_with_the_native_twin_s_bits(others, partners, trajectories, name, engine, isolated):
    network = run.load(
        partners(f"""
        run: {{stop: 1, step: 0.01}}
        fleets: {{robot: 3}}
        blocks:
          source: {{type: Source, per: robot, parameters: {{A: i}}}}
          twin: {{type: Lag, per: robot, inputs: {{u: source.u}}, parameters: {{T: "i/4"}}}}
          plant:
            fmu: {others[name]}
            isolate: {isolated}
            per: robot
            inputs: {{u: source.u}}
            parameters: {{T: "i/4", label: [a, b, c]}}
        """)
    )
    got = trajectories(network, "twin.x", "plant.x", "plant.steps", "plant.high", engine=engine)
    assert np.array_equal(got["twin.x"], got["plant.x"])
    assert np.array_equal(got["plant.steps"], np.repeat(np.arange(101)[:, None], 3, axis=1))
    assert np.array_equal(got["plant.high"], got["plant.x"] > 0.5)


@pytest.mark.parametrize("name", ["PythonLag2", "PythonLag3"])
def test_five_native_robots_and_one_fmu(others, partners, trajectories, name):
    network = run.load(
        partners(f"""
        run: {{stop: 1, step: 0.01}}
        fleets: {{five: 5, six: 6}}
        blocks:
          source: {{type: Source}}
          native: {{type: Lag, per: five, inputs: {{u: source.u}}, parameters: {{T: "i/8"}}}}
          other: {{fmu: {others[name]}, inputs: {{u: source.u}}, parameters: {{T: 0.75}}}}
          all: {{type: Lag, per: six, inputs: {{u: source.u}}, parameters: {{T: "i/8"}}}}
          follower: {{type: Follower, inputs: {{u: [native.x, other.x]}}}}
          reference: {{type: Follower, inputs: {{u: all.x}}}}
        """)
    )
    got = trajectories(network, "follower.x", "reference.x")
    assert np.array_equal(got["follower.x"], got["reference.x"])


def test_a_python_model_exchange_fmu_is_integrated_by_us(others, partners, trajectories):
    """Explicit Euler on x'' = -w^2 x multiplies x + iv/w by (1 + ihw) in every step."""
    network = run.load(
        partners(f"""
        run: {{stop: 1, step: 0.01}}
        blocks: {{plant: {{fmu: {others["PythonOscillator"]}, parameters: {{w: 3}}, start: {{x: 0.5}}}}}}
        """)
    )
    got = trajectories(network, "plant.x", "plant.v")
    exact = 0.5 * (1 - 0.03j) ** np.arange(101)
    assert got["plant.x"] == pytest.approx(exact.real, abs=1e-13)
    assert got["plant.v"] == pytest.approx(3 * exact.imag, abs=1e-13)


@pytest.mark.parametrize("name", ["PythonLag2", "PythonLag3"])
def test_an_exception_in_python_stops_the_run_with_its_words(others, partners, name):
    outcome = Run(
        run.load(
            partners(f"""
        run: {{stop: 1, step: 0.01}}
        fleets: {{robot: 2}}
        blocks: {{plant: {{fmu: {others[name]}, per: robot, parameters: {{label: [fine, broken]}}}}}}
        """)
        )
    ).execute()
    assert isinstance(outcome.error, FmuFailed)
    assert f"({name}.fmu, robot 2) failed at t = 0.5 s" in str(outcome.error)
    assert "this one is broken" in str(outcome.error)
    assert (outcome.status, outcome.steps) == ("failed", 50)


@pytest.mark.parametrize("name", ["PythonLag2", "PythonLag3"])
def test_a_step_that_it_refuses_stops_the_run(others, partners, name):
    text = f"""
        run: {{stop: 1, step: 0.01}}
        blocks: {{plant: {{fmu: {others[name]}, parameters: {{label: lazy}}}}}}
        """
    outcome = Run(run.load(partners(text))).execute()
    assert outcome.steps == 0
    if name == "PythonLag2":  # PythonFMU says fmi2Terminated of every step that it refuses
        assert outcome.status == "terminated"
        assert "ended the simulation at t = 0 s" in outcome.reason
    else:
        assert isinstance(outcome.error, FmuFailed)
        assert "DoStep() returned `discard`" in str(outcome.error)


def test_inspection_finds_the_tool_and_its_flaws(others):
    text = inspect.text(others["PythonLag2"])
    assert "by PythonFMU" in text
    assert "needs the tool that made it" in text
    assert "validation finds" in text
