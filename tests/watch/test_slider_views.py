"""Sliders: which parameters have one, between which values, and what is written to keep what it says."""

import pytest

from cosim.errors import Position
from cosim.language import source
from cosim.watch import slider_views

DIAGRAM = """
run: {stop: 1, step: 0.01}
fleets: {robot: 3}
blocks:
  step: {block: Step, parameters: {at: 0.1, final: 2}}
  noise: {block: WhiteNoise, period: 0.01, parameters: {seed: 7, deviation: 0.5}}
  pid: {block: PID, parameters: {k_p: 4, k_d: 0, T_f: 1, lower: -24, upper: inf}, inputs: {r: step.y, y: motor.y}}
  motor:
    block: StateSpace
    parameters: {A: [[-500, "-50"], [100, -0.1]], B: [[500], [0]], C: [[0, 1]]}
    inputs: {u: pid.u}
  robots: {block: Gain, per: robot, parameters: {k: i}, inputs: {u: step.y}}
  same: {block: Gain, per: robot, parameters: {k: "1/2"}, inputs: {u: step.y}}
"""


@pytest.fixture
def sliders(wired):
    return {view["path"]: view for view in slider_views.views(wired(DIAGRAM))}


def test_numbers_have_sliders_and_what_differs_by_member_has_none(sliders):
    paths = {path.removeprefix("blocks.") for path in sliders}
    assert {"step.parameters.final", "pid.parameters.k_p", "noise.parameters.deviation", "same.parameters.k"} <= paths
    assert not {"robots.parameters.k", "pid.parameters.upper"} & paths
    assert {"motor.parameters.A.0.0", "motor.parameters.A.1.1"} <= paths
    assert "motor.parameters.A.0.1" not in paths  # arithmetic, in a text
    assert sliders["blocks.same.parameters.k"]["value"] == 0.5


@pytest.mark.parametrize(
    ("path", "low", "high"),
    [
        ("blocks.step.parameters.final", 0, 4),
        ("blocks.pid.parameters.lower", -48, 0),
        ("blocks.pid.parameters.k_d", -1, 1),  # zero says nothing of a size
        ("blocks.noise.parameters.deviation", 0, 1),  # not below its limit
        ("blocks.motor.parameters.A.0.0", -1000, 0),
    ],
)
def test_ranges_reach_from_zero_to_twice_the_value_within_limits(sliders, path, low, high):
    assert (sliders[path]["low"], sliders[path]["high"]) == (low, high)


def test_whole_numbers_stay_whole(sliders):
    seed = sliders["blocks.noise.parameters.seed"]
    assert seed["integer"] and seed["value"] == 7 and isinstance(seed["value"], int)


def test_what_is_to_be_written_says_the_value_and_nothing_else(sliders, wired):
    chosen = {"blocks.pid.parameters.k_p": 3.5, "blocks.motor.parameters.A.1.0": 90.0}
    scalar, element = slider_views.lines(sliders, chosen)
    assert source.parse_value(scalar["yaml"], Position("")).plain() == {"blocks": {"pid": {"parameters": {"k_p": 3.5}}}}
    matrix = {"blocks": {"motor": {"parameters": {"A": [[-500, "-50"], [90.0, -0.1]]}}}}
    assert source.parse_value(element["yaml"], Position("")).plain() == matrix
    network = wired(DIAGRAM, *(line["option"].removeprefix("--set ") for line in (scalar, element)))
    assert network.components["pid"].values["k_p"].ravel() == [3.5]
    assert network.components["motor"].values["A"].ravel().tolist() == [-500, -50, 90, -0.1]
    assert slider_views.lines(sliders, {"blocks.none.parameters.k": 1.0}) == []
