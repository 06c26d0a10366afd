"""Members that differ in values only are not wired again, and yet are the runs that a full load gives."""

import json

import numpy as np
import pytest

from cosim.engine import run as runs
from cosim.results import result_file
from cosim.study import member_run, plan, running, study_file
from cosim.study.running import Options
from cosim.study.variants import Variants

SETTINGS = [
    ("blocks.lag.start.x", [[0.3, -0.1], [0.1, 0.7], [1 / 3, 2.0]]),  # replaces a list of the diagram
    ("blocks.lag.start.x.1.0", 0.123),  # one element of it
    ("blocks.lag.parameters.T", 0.7),  # one value for all
    ("blocks.lag.parameters.T", [0.7, 0.8, 0.9]),  # one value each: another layout
    ("blocks.lag.parameters.T", "i / 2"),  # an expression
    ("blocks.swing.parameters.w", 3),
    ("blocks.swing.start.v", 0.5),  # not in the diagram
    ("blocks.source.parameters.A", 2.5),  # whose default is an expression
    ("run.stop", 0.5),  # structure
]


def different(value):
    """A value of the same shape."""
    if isinstance(value, list):
        return [different(item) for item in value]
    return f"1 + {value}" if isinstance(value, str) else value + 0.25


@pytest.mark.parametrize(("path", "value"), SETTINGS)
def test_fast_members_give_the_bits_of_a_full_load(study, tmp_path, path, value):
    other = different(value)
    text = f"diagram: diagram.yaml\ngrid: {{{path}: [{json.dumps(other)}, {json.dumps(value)}]}}"
    loaded = study(text)
    variants = Variants(loaded)
    first, second = plan.members(loaded, None)
    variants.prepared(first)  # the template, which the second one is made from where it can be
    row = member_run.run(variants, second, None)
    network = runs.load(tmp_path / "diagram.yaml", [f"{path}={json.dumps(value)}", "record.signals=[]"])
    expected = runs.Run(network).execute()
    assert row["metrics"] == expected.metrics
    assert row["steps"] == expected.steps


def test_values_share_one_template_and_structures_do_not(study):
    loaded = study("diagram: diagram.yaml\ngrid: {blocks.swing.parameters.w: [1, 2, 3], run.stop: [1, 2]}")
    variants = Variants(loaded)
    for one in plan.members(loaded, None):
        variants.prepared(one)
    assert len(variants._templates) == 2


def test_recorded_members_say_which_diagram_they_come_from(study, tmp_path):
    from cosim.results.result_file import open_result

    loaded = study("{diagram: diagram.yaml, record: true, grid: {blocks.swing.parameters.w: [1, 4]}}")
    _, second = plan.members(loaded, None)
    row = member_run.run(Variants(loaded), second, tmp_path / "one.nc")
    with open_result(tmp_path / "one.nc") as result:
        (tmp_path / "again.yaml").write_text(result.attrs["diagram"])
        swing = result["swing.x"]
    again = runs.Run(runs.load(tmp_path / "again.yaml")).execute()
    assert again.metrics == row["metrics"]
    assert np.isclose(swing[-1], row["metrics"]["last"])


CONSTANT = """
    run: {stop: 1, step: 0.01}
    blocks:
      source: {type: Sine, parameters: {A: 1}}
      lag: {type: Lag, dimensions: {n: 2}, inputs: {u: [0.5, 1]}}
    record: {period: 0.1, signals: [lag.x]}
    metrics:
      top: {signal: lag.x, reduce: max}
    """


def test_constants_of_inputs_are_values_and_a_wire_in_their_place_is_structure(study, tmp_path):
    values = ["[1, 2]", "[0.5, 3]", "source.y", "7"]
    axis = f"grid: {{blocks.lag.inputs.u: [{', '.join(values)}]}}"
    loaded = study(f"{{diagram: diagram.yaml, record: true, {axis}}}", CONSTANT)
    variants = Variants(loaded)
    members = list(plan.members(loaded, None))
    assert len({variants.prepared(member).key for member in members}) == 4
    assert len(variants._templates) == 3  # a list, a wire, one number for all
    for member, value in zip(members, values, strict=True):
        row = member_run.run(variants, member, tmp_path / "one.nc")
        alone = runs.Run(runs.load(tmp_path / "diagram.yaml", [f"blocks.lag.inputs.u={value}"])).execute()
        assert row["metrics"] == alone.metrics
        with result_file.open_result(tmp_path / "one.nc") as result:
            (tmp_path / "again.yaml").write_text(result.attrs["diagram"])
        assert runs.Run(runs.load(tmp_path / "again.yaml")).execute().metrics == row["metrics"]


WHOLE = """
from cosim import *

class Digits(Block):
    K = Parameter("n", "m", dtype=int)
    y = Output()

    def outputs(K, y):
        y[0] = 1000 * K[0, 0] + 100 * K[0, 1] + 10 * K[1, 0] + K[1, 1]
"""


def test_real_numbers_for_a_matrix_of_whole_ones(tmp_path):
    (tmp_path / "own.py").write_text(WHOLE)
    np.savez(tmp_path / "k.npz", K=np.array([[9, 8], [7, 6]]))
    diagram = (
        "run: {stop: 1, step: 1}\nblocks: {d: {python: 'own.py:Digits', parameters: {K: {file: k.npz, array: K}}}}\n"
    )
    (tmp_path / "d.yaml").write_text(diagram + "metrics: {y: {signal: d.y, reduce: final}}\n")
    assert runs.run(runs.load(tmp_path / "d.yaml").diagram).metrics["y"] == 9876
    values = "[[[1, 2], [3, 4]], [[5.0, 6.0], [7.0, 8.0]], [[5.0, 6], [7, 9]]]"
    (tmp_path / "s.yaml").write_text(f"diagram: d.yaml\ngrid: {{blocks.d.parameters.K: {values}}}\n")
    found = running.run(study_file.load(tmp_path / "s.yaml"), Options(folder=tmp_path / "r"))
    assert [row["metrics"]["y"] for row in found.rows()] == [1234, 5678, 5679]
