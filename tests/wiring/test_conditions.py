"""Conditions of theorems: what is judged before a run, and what along it."""

import json
import math

import numpy as np
import pytest

from cosim.authoring.block import Block
from cosim.authoring.rules import Course, condition, rule
from cosim.authoring.variables import Output, Parameter
from cosim.engine import run
from cosim.engine.courses import Courses
from cosim.errors import DeclarationError, DiagramErrors
from cosim.results.result_file import open_result
from cosim.terminal.cli import main
from cosim.wiring import conditions

BLOCKS = '''
from cosim import Block, Input, Output, Parameter
from cosim import condition

class Wave(Block):
    """A sine of the time."""
    amplitude = Parameter(default=1.0)
    y = Output()
    low = condition("y < 2", "Theorem 9")(lambda y: (y.largest < 2.0, f"{y.largest:.3g} at t = {y.largest_at:.3g} s"))
    def outputs(time, amplitude, y):
        y[0] = amplitude * math.sin(time)

class Reader(Block):
    """Knows what stands before it, and how long the run is."""
    u = Input()
    y = Output()
    @condition("one wave before")
    def upstream(u, stop):
        before = u.inputs.get("u")
        told = f", then {before.block} of {before.parameters['amplitude']}" if before else ""
        return None, f"{u.block}{told} until {stop}"
    def outputs(u, y):
        y[0] = u
'''.replace("from cosim import", "import math\nfrom cosim import", 1)

DIAGRAM = """
run: {stop: 3, step: 0.01}
fleets: {ship: 3}
blocks:
  wave: {python: blocks.py:Wave, per: ship, parameters: {amplitude: [1, 3, 4]}}
  one: {python: blocks.py:Wave, parameters: {amplitude: 1.5}}
  first: {python: blocks.py:Reader, inputs: {u: one.y}}
  second: {python: blocks.py:Reader, inputs: {u: first.y}}
"""


@pytest.fixture
def diagram(tmp_path):
    (tmp_path / "blocks.py").write_text(BLOCKS)
    path = tmp_path / "diagram.yaml"
    path.write_text(DIAGRAM)
    return path


def test_a_condition_on_what_a_block_computes_is_judged_along_the_run(diagram):
    network = run.load(diagram)
    outcome = run.Run(network, engine="python").execute()
    found = {(f.component, f.holds): f.numbers for f in outcome.conditions}
    assert found == {
        ("wave", True): "ship 1: 1 at t = 1.57 s",
        ("wave", False): "ship 2 and 1 more: 3 at t = 1.57 s",
        ("one", True): "1.5 at t = 1.57 s",
    }
    (warning,) = outcome.warnings
    assert "wave: Theorem 9, y < 2: ship 2" in warning.message
    assert warning.position == network.components["wave"].entry.position
    assert [f for f in conditions.conditions(network) if f.component == "wave"] == []


def test_the_terminal_and_json_tell_what_failed_along_the_run(diagram, capsys, monkeypatch):
    monkeypatch.chdir(diagram.parent)
    assert main(["run", "diagram.yaml", "--engine", "python"]) == 0
    assert "diagram.yaml:5:3: warning: wave: Theorem 9, y < 2: ship 2 and 1 more: 3 at" in capsys.readouterr().err
    assert main(["run", "diagram.yaml", "--engine", "python", "--json"]) == 0
    conditions = json.loads(capsys.readouterr().out)["conditions"]
    assert [c["holds"] for c in conditions if c["component"] == "wave"] == [True, False]
    assert main(["check", "diagram.yaml"]) == 0
    assert "run    wave: Theorem 9, y < 2" in capsys.readouterr().out


def test_the_result_keeps_what_was_judged(diagram):
    outcome = run.Run(run.load(diagram), engine="python", output=diagram.with_name("run.nc")).execute()
    with open_result(diagram.with_name("run.nc")) as result:
        assert result.attrs["conditions"] == outcome.verdicts
    assert {(c["component"], c["holds"]) for c in outcome.verdicts} == {("wave", True), ("wave", False), ("one", True)}


def test_a_condition_sees_the_blocks_before_it_and_the_runs_end(diagram, capsys):
    findings = {
        f.component: f for f in conditions.conditions(run.load(diagram, ["run.stop=7"])) if f.component == "second"
    }
    assert findings["second"].numbers == "Reader, then Wave of 1.5 until 7.0"
    assert findings["second"].holds is None


def test_nobody_can_say_is_not_holds(diagram, capsys):
    assert main(["check", str(diagram)]) == 0
    printed = capsys.readouterr()
    assert "open   second: condition, one wave before: Reader, then Wave" in printed.out
    assert "second" not in printed.err


def test_a_condition_that_raises_loses_nothing(diagram):
    (diagram.parent / "blocks.py").write_text(BLOCKS.replace("y.largest < 2.0", "1 / (y.largest * 0) > 2.0"))
    outcome = run.Run(run.load(diagram), engine="python").execute()
    assert outcome.status == "completed"
    assert {f.numbers for f in outcome.conditions} == {"cannot be judged: ZeroDivisionError: float division by zero"}
    assert len(outcome.warnings) == 2


BROKEN = "if amplitude > 0.0:\n            raise ValueError('broken')\n        y[0] = 0.0"


def test_a_run_that_ends_before_its_first_sample_is_not_judged(diagram):
    (diagram.parent / "blocks.py").write_text(BLOCKS.replace("y[0] = amplitude * math.sin(time)", BROKEN))
    outcome = run.Run(run.load(diagram), engine="python").execute()
    assert (outcome.status, outcome.conditions) == ("failed", [])


def test_a_rule_names_only_what_is_known_before_the_run():
    with pytest.raises(DeclarationError, match="rule `y > 0` names `y`") as caught:

        class Early(Block):
            y = Output()
            positive = rule("y > 0")(lambda y: y > 0)

            def outputs(y):
                y[0] = 1.0

    assert "condition" in caught.value.fix
    with pytest.raises(DeclarationError, match="names `amplitud`") as caught:

        class Misspelt(Block):
            amplitude = Parameter()
            small = condition("amplitude < 1")(lambda amplitud: amplitud < 1)

    assert "`amplitude`" in caught.value.fix


@pytest.mark.parametrize("batches", [1, 4, 100])
def test_courses_are_the_extremes_of_all_samples(batches):
    rng = np.random.default_rng(3)
    times, samples = np.arange(100) * 0.1, rng.normal(size=(100, 2, 3))
    courses = Courses(2)
    for part in np.array_split(np.arange(100), batches):
        courses.update(times[part], samples[part])
    for member, course in enumerate(courses.of_members()):
        own = samples[:, member]
        low, high = own.min(axis=1).argmin(), own.max(axis=1).argmax()
        assert course == Course(own.min(), times[low], own.max(), times[high])


def test_a_nan_stays_the_extreme():
    courses = Courses(1)
    courses.update(np.array([0.0, 1.0, 2.0]), np.array([1.0, math.nan, 5.0]))
    courses.update(np.array([3.0]), np.array([-9.0]))
    (course,) = courses.of_members()
    assert math.isnan(course.smallest) and math.isnan(course.largest)
    assert course.smallest_at == course.largest_at == 1.0


@pytest.mark.parametrize("dtype", [np.int64, np.uint64])
def test_extremes_of_integers_are_exact(dtype):
    """A float64 holds no integer beyond 2^53."""
    courses = Courses(2)
    low, high = 2**53 + 1, 2**62 + 1
    courses.update(np.array([0.0]), np.array([[high, 5]], dtype))
    courses.update(np.array([1.0, 2.0]), np.array([[low, 7], [high, 6]], dtype))
    assert courses.of_members() == [Course(low, 1.0, high, 0.0), Course(5, 0.0, 7, 1.0)]
    assert isinstance(courses.of_members()[0].largest, int)


def test_the_first_of_equal_extremes_counts():
    courses = Courses(1)
    courses.update(np.array([0.0, 1.0]), np.array([2, 2]))
    courses.update(np.array([2.0]), np.array([2]))
    assert courses.of_members() == [Course(2.0, 0.0, 2.0, 0.0)]


MANY = """
run: {stop: 3, step: 0.01}
fleets: {ship: 1000}
blocks:
  wave: {python: many.py:Wave, per: ship, parameters: {amplitude: "AMPLITUDE", phase: "i % 3"}}
"""
OF_MANY = '''
from cosim import Block, Output, Parameter, condition, rule

judged = []

class Wave(Block):
    """Of an amplitude, two of which are judged together."""
    amplitude = Parameter()
    phase = Parameter()
    y = Output()
    positive = rule("amplitude > 0")(lambda amplitude, phase: judged.append((amplitude, phase)) or amplitude > 0.0)
    low = condition("amplitude < 5", "Theorem 9")(lambda amplitude: (amplitude < 5.0, f"it is {amplitude:g}"))
    def outputs(amplitude, y):
        y[0] = amplitude
'''


@pytest.fixture
def many(tmp_path):
    """A network of a thousand ships with these amplitudes."""

    def load(amplitude):
        (tmp_path / "many.py").write_text(OF_MANY)
        (tmp_path / "many.yaml").write_text(MANY.replace("AMPLITUDE", amplitude))
        return run.load(tmp_path / "many.yaml")

    return load


def test_members_that_a_rule_cannot_tell_apart_are_judged_once(many):
    network = many("1 + i % 2")
    judged = network.components["wave"].declaration.rules[0].function.__globals__["judged"]
    assert judged == [(2.0, 1.0), (1.0, 2.0), (2.0, 0.0), (1.0, 1.0), (2.0, 2.0), (1.0, 0.0)]  # in the members' order


def test_the_one_of_a_thousand_that_breaks_a_rule_is_found(many):
    with pytest.raises(DiagramErrors) as found:
        many("1 - 2*(1 if i == 517 else 0)")
    (mistake,) = found.value.errors
    assert "requires amplitude > 0" in mistake.message


def test_those_of_which_a_condition_fails_are_counted(many):
    """Of 1,000 ships, every seventh from the 7th on has an amplitude of 6: 142 of them."""
    found = {f.holds: f.numbers for f in conditions.conditions(many("6 if i % 7 == 0 else 1"))}
    assert found == {True: "ship 1 and 857 more: it is 1", False: "ship 7 and 141 more: it is 6"}
