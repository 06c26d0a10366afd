"""Requirements of studies: where they may stand, how often they are violated, with which probability, on threads."""

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from cosim.report import document
from cosim.study import kept, text_tables
from cosim.terminal.cli import main
from tests.study.conftest import DIAGRAM, STUDY, written

NESTED = """
    run: {stop: 3, step: 0.01}
    fleets: {robot: 3}
    blocks:
      source: {type: Sine, per: robot}
      lag: {type: Lag, per: robot, inputs: {u: source.y}, start: {x: 0}}
    requirements:
      one: always[0, 1](eventually[0, 1](norm(lag.x) < 1.5))
      two: eventually[0, 2](always[0, 0.5](lag.x > -9))
      three: always((lag.x > -1) until[0.1, 0.5] (lag.x < 2))
      four: always[0.2, 1](eventually[0.1, 0.3](lag.large or lag.x < 1) implies eventually(norm(lag.x) < 9))
    """
DRAWN = """
    diagram: diagram.yaml
    random: {count: 100, seed: 1, draws: {blocks.lag.start.x: {uniform: [-2, 2]}}}
    """


def test_in_the_diagram_a_variant_and_the_study(results):
    """The outer wins, and adds; a variant's own is its own."""
    slow = "slow: {requirements: {own: always(lag.x < 99)}}"
    text = STUDY.replace("slow: {set: {blocks.lag.parameters.T: 2}}", slow)
    text += "requirements: {swung: always(swing.x > -8)}\n    "
    diagram = DIAGRAM + "requirements: {high: always(swing.x < 1.5), swung: always(swing.x > -9)}\n    "
    rows = list(results(text, diagram).rows())
    assert {row["variant"]: set(row["requirements"]) for row in rows} == {
        "plain": {"high", "swung"},
        "slow": {"high", "swung", "own"},
    }
    assert all(row["metrics"]["swung"] == row["metrics"]["low"] + 8 for row in rows)


def shares(found) -> list[float]:
    """The shares of violated and of kept runs, as the table has them."""
    return [float(cell.split("%")[0]) / 100 for cell in text_tables.tables(found)[0].rows[0][-2:]]


def swinging(share: float, below: str = "always(swing.x < 0.3)") -> tuple[str, str]:
    """A study of starts of the oscillator drawn from [0, share], and its diagram: its amplitude is what is drawn."""
    diagram = f"""
    run: {{stop: 4, step: 0.01, integrator: rk4}}
    blocks: {{swing: {{type: Oscillator, parameters: {{w: 2}}}}}}
    requirements: {{high: "{below}"}}
    """
    study = f"""
    diagram: diagram.yaml
    random: {{count: 60, seed: 3, draws: {{blocks.swing.start.x: {{uniform: [0, {share}]}}}}}}
    tables:
      all:
        columns: {{least: {{metric: high}}, violated: {{metric: high, below: 0}}, kept: {{metric: high, above: 0}}}}
    """
    return textwrap.dedent(study), diagram


def test_shares_and_probabilities_are_those_of_the_draws(results):
    """x = a cos 2t stays below 0.3 where a does."""
    found = results(*swinging(0.6))
    rows = list(found.rows())
    starts = 0.3 - np.array([row["metrics"]["high"] for row in rows])  # the largest x is the first
    assert starts.min() >= 0 and starts.max() <= 0.6
    violated = int((starts > 0.3).sum())
    assert 0 < violated < 60
    assert shares(found) == pytest.approx([violated / 60, 1 - violated / 60], abs=1e-3)
    least = text_tables.tables(found)[0].rows[0][-3]
    assert float(least) == pytest.approx(0.3 - starts.max(), abs=5e-4)
    (one,) = kept.as_json(found.study, rows)
    bounds = binomtest(violated, 60).proportion_ci(confidence_level=0.95, method="exact")
    assert one["probability"] == pytest.approx(tuple(bounds), rel=1e-12)
    assert (one["runs"], one["violated"], one["undecided"]) == (60, violated, 0)
    assert one["least"]["margin"] == min(row["metrics"]["high"] for row in rows)


@pytest.mark.parametrize(("count", "trials"), [(0, 1), (1, 1), (0, 50), (50, 50), (3, 20), (17, 1000)])
def test_the_interval_is_that_of_clopper_and_pearson(count, trials):
    bounds = binomtest(count, trials).proportion_ci(confidence_level=0.95, method="exact")
    assert kept.interval(count, trials) == pytest.approx(tuple(bounds), rel=1e-12)


def test_draws_that_fill_the_space_evenly_are_no_trials(results):
    study, diagram = swinging(0.6)
    for method in ("sobol", "latin-hypercube"):
        found = results(study.replace("count: 60", f"count: 64, method: {method}"), diagram)
        (one,) = kept.as_json(found.study, found.rows())
        assert one["probability"] is None and one["runs"] == 64
        assert "%" not in str(kept.table(found.study, found.rows()).rows)


def test_runs_without_a_verdict_may_be_either(results):
    """Those that diverge, and those that a window has no sample of."""
    diagram = """
    run: {stop: 1, step: 0.01}
    blocks: {one: {type: Explosive}}
    requirements: {low: "always(one.x < 1e9)", never: "always[0.5, 1](one.x > -1)"}
    """
    study = "diagram: diagram.yaml\nrandom: {count: 40, seed: 3, draws: {blocks.one.start.x: {uniform: [0.5, 1.5]}}}\n"
    found = results(study, diagram)
    rows = list(found.rows())
    never = kept.as_json(found.study, rows)[1]
    stopped = sum(row["status"] == "diverged" for row in rows)
    assert 0 < stopped < 40
    assert never["undecided"] == stopped and never["runs"] == 40 - stopped and never["violated"] == 0
    assert never["probability"][0] == 0
    assert never["probability"][1] == pytest.approx(
        binomtest(stopped, 40).proportion_ci(method="exact").high, rel=1e-12
    )


def test_a_margin_of_zero_that_violates_is_below_zero(results):
    study, diagram = swinging(0.6, "always[0, 0](swing.x < swing.x)")
    found = results(study, diagram)
    assert shares(found) == [1, 0] and text_tables.tables(found)[0].rows[0][-3] == "0"


def test_truth_values_are_counted(results):
    study, diagram = swinging(0.6, "always(lag.large)")
    blocks = (
        "line: {block: Join, inputs: {u: [swing.x, swing.x]}}, lag: {type: Lag, inputs: {u: line.y}, start: {x: 0}}"
    )
    assert shares(results(study, diagram.replace("blocks: {", f"blocks: {{{blocks}, "))) == [1, 0]


def test_a_new_requirement_reruns_what_has_no_verdict_on_it(results):
    study, diagram = swinging(0.6)
    results(study, diagram)
    again = results(study + "requirements: {more: always(swing.x > -1)}\n", diagram)
    assert (again.ran, again.reused) == (60, 0)
    assert all(set(row["requirements"]) == {"high", "more"} for row in again.rows())
    assert results(study + "requirements: {more: always(swing.x > -1)}\n", diagram).ran == 0


def test_the_command_tells_and_its_exit_code_is_of_violations(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    study, diagram = swinging(0.6)
    written(tmp_path, diagram, "diagram.yaml")
    path = written(tmp_path, study, "study.yaml")
    assert main(["study", str(path)]) == 3
    out = capsys.readouterr().out
    assert "of 60" in out and "probability, 95 %" in out
    assert main(["study", str(path), "--json"]) == 3
    answer = json.loads(capsys.readouterr().out)
    assert answer["requirements"][0]["requirement"] == "high"
    assert main(["study", str(path), "--member", answer["requirements"][0]["least"]["run"]]) == 3
    written(tmp_path, diagram.replace("< 0.3", "< 0.7"), "diagram.yaml")
    assert main(["study", str(path)]) == 0


def test_the_report_has_them(results):
    study, diagram = swinging(0.6)
    found = results(study, diagram)
    path = Path(found.study.path).parent / "report.html"
    document.write(path, [found])
    assert "probability, 95 %" in path.read_text() and "of 60" in path.read_text()


MISTAKES = {
    "requirements: {high: always(nobody.x < 1)}": "`nobody.x` names no block",
    "requirements: [high]": "`study.requirements` must be",
    "requirements: {top: always(swing.x < 1)}": "is a requirement and a metric",
    "requirements: {variant: always(swing.x < 1)}": "no figure can be called `variant`",
    "requirements: {high: always(swing.x < 1}": "requirement high: `)` is expected",
}


@pytest.mark.parametrize(("text", "message"), MISTAKES.items())
def test_mistakes_of_a_study(tmp_path, monkeypatch, capsys, text, message):
    monkeypatch.chdir(tmp_path)
    written(tmp_path, DIAGRAM, "diagram.yaml")
    path = written(tmp_path, f"diagram: diagram.yaml\n{text}\n", "study.yaml")
    assert main(["study", str(path)]) == 2
    assert message in capsys.readouterr().err


# ---- threads ----

THREADS = """
import sys
from pathlib import Path
from cosim.study import running, study_file
from cosim.study.running import Options
found = running.run(study_file.load(Path(sys.argv[1])), Options(Path(sys.argv[2]), threads=4))
print(repr([(row["metrics"], row["requirements"]) for row in found.rows()]))
"""


def test_a_hundred_members_on_four_threads_ten_times(tmp_path, new_cache):
    """Each in a process of its own: the same margins, without a crash, also where only the loop is compiled."""
    written(tmp_path, NESTED, "diagram.yaml")
    path = written(tmp_path, DRAWN, "study.yaml")
    printed = set()
    for k in range(10):
        done = subprocess.run(
            [sys.executable, "-c", THREADS, str(path), str(tmp_path / f"results{k}")],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        printed.add(done.stdout)
    assert len(printed) == 1 and printed.pop().count("'one'") == 200


TOGETHER = """
from threading import Barrier, Thread
import numpy as np
from cosim.requirements.operators import Operators
barrier, found = Barrier(8), []
times, values = np.arange(50.0), np.sin(np.arange(50.0))
def compute():
    barrier.wait()
    found.append(Operators(True, times).lowest(values, 1.0, 5.0).tobytes())
threads = [Thread(target=compute) for _ in range(8)]
[thread.start() for thread in threads]
[thread.join() for thread in threads]
assert set(found) == {Operators(False, times).lowest(values, 1.0, 5.0).tobytes()} and len(found) == 8
"""


def test_threads_that_all_want_the_operators_at_first(tmp_path):
    for k in range(3):
        done = subprocess.run(
            [sys.executable, "-c", TOGETHER],
            env={**os.environ, "COSIM_CACHE": str(tmp_path / f"{k}")},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
