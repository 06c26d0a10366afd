"""What the library's blocks refuse, each with the place of the value that is wrong."""

import pytest

from cosim.engine import run
from cosim.errors import DiagramErrors


@pytest.mark.parametrize(
    ("block", "parameters", "said"),
    [
        ("Saturation", "lower: 2, upper: 1", "lower < upper"),
        ("Saturation", "lower: [0, 2], upper: 1", "`lower` has the shape ()"),
        ("DeadZone", "lower: 1, upper: 0", "lower <= upper"),
        ("Relay", "lower: 1, upper: 0", "lower <= upper"),
        ("Quantiser", "interval: 0", "interval > 0"),
        ("LookUp1D", "points: [0, 2, 1], values: [1, 2, 3]", "points ascending"),
        ("LookUp1D", "points: [0, 1], values: [1, 2, 3]", "`values` has the shape (k = 2), not (3,)"),
        ("TransferFunction", "numerator: [1, 2], denominator: [1, 3]", "fewer coefficients in the numerator"),
        ("TransferFunctionFeedthrough", "numerator: [1, 2, 3], denominator: [1, 3]", "no more coefficients"),
        ("TransferFunction", "denominator: [0, 3, 1]", "whose first is not 0"),
        ("ZeroPoleGain", "zeros: [1, 2], poles: [-1, -2]", "fewer zeros than poles"),
        ("FirstOrder", "T: 0", "T > 0"),
        ("LeadLag", "T_2: -1", "T_2 > 0"),
        ("LowPass", "cutoff: 0", "cutoff > 0"),
        ("Notch", "Q: 0", "centre, Q > 0"),
        ("Sum", "signs: [1, 2]", "signs are 1 or -1"),
        ("Sum", "signs: [1, 0.5]", "no whole number"),
        ("StateSpace", "A: [[1, 2]], B: [[1]], C: [[1]]", "`A` has the shape"),
        ("MatrixGain", "", "parameter `K` of MatrixGain has no value"),
        ("Encoder", "counts_per_turn: 0", "counts_per_turn > 0"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path, block, parameters, said):
    port = "u_1" if block == "Sum" else "u"
    source = "Sine" if block != "Encoder" else "Atan2, inputs: {y: one.y, x: one.y}"
    output = "theta" if block == "Encoder" else "y"
    path = tmp_path / "d.yaml"
    path.write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  one: {block: Sine}\n"
        f"  s: {{block: {source}}}\n  b: {{block: {block}, inputs: {{{port}: s.{output}}},\n"
        f"      parameters: {{{parameters}}}}}\n"
    )
    with pytest.raises(DiagramErrors) as caught:
        run.load(path)
    assert said in str(caught.value)
    assert "d.yaml:6:" in str(caught.value) or "d.yaml:5:3" in str(caught.value)


def test_a_term_without_a_sign_is_told(tmp_path):
    path = tmp_path / "d.yaml"
    path.write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  s: {block: Sine}\n"
        "  b: {block: Sum, inputs: {u_1: s.y, u_2: s.y, u_3: s.y}, parameters: {signs: [1, -1]}}\n"
    )
    with pytest.raises(DiagramErrors, match="a sign for each input that is wired"):
        run.load(path)


@pytest.mark.parametrize(
    ("inputs", "signs", "missing"),
    [
        ("u_1: s.y", "[1, -1]", "u_2"),
        ("u_1: s.y, u_3: s.y", "[1, -1, 1]", "u_2"),
        ("u_1: s.y, u_2: s.y", "[1, 1, 1, -1]", "u_3, u_4"),
        ("u_1: s.y, u_2: s.y", "[1, 1, 1]", "u_3"),
        ("u_1: s.y, u_2: 3", "[1, -1]", None),
        ("u_1: 2, u_2: s.y", "[1, -1]", None),
        ("u_1: s.y", "[-1]", None),
        ("u_1: s.y, u_3: s.y", None, None),
    ],
)
def test_a_sign_whose_term_is_not_wired_is_told(tmp_path, inputs, signs, missing):
    path = tmp_path / "d.yaml"
    given = f", parameters: {{signs: {signs}}}" if signs else ""
    path.write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  s: {block: Sine}\n"
        f"  b: {{block: Sum, inputs: {{{inputs}}}{given}}}\n"
    )
    if missing is None:
        run.load(path)
        return
    with pytest.raises(DiagramErrors, match=f"a wire or a constant for each sign(.|\n)*and no {missing}"):
        run.load(path)


def test_a_constant_term_without_a_sign_is_told(tmp_path):
    path = tmp_path / "d.yaml"
    path.write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  s: {block: Sine}\n"
        "  b: {block: Sum, inputs: {u_1: s.y, u_2: s.y, u_3: 4}, parameters: {signs: [1, -1]}}\n"
    )
    with pytest.raises(DiagramErrors, match="a sign for each input that is wired"):
        run.load(path)


def test_a_lag_of_no_input_and_sampled_blocks_without_a_period(tmp_path):
    path = tmp_path / "d.yaml"
    path.write_text(
        "run: {stop: 1, step: 0.1}\nblocks:\n  s: {block: Sine}\n  b: {block: UnitDelay, inputs: {u: s.y}}\n"
    )
    with pytest.raises(DiagramErrors, match=r"add `period: 0\.1`"):
        run.load(path)
    path.write_text("run: {stop: 1, step: 0.1}\nblocks:\n  b: {block: FirstOrder}\n")
    with pytest.raises(DiagramErrors, match="input `u` is not connected"):
        run.load(path)


def _diagram(path, block, parameters, inputs=""):
    path.write_text(
        "run: {stop: 0.5, step: 0.125}\nblocks:\n  s: {block: Sine}\n  v: {block: Sine, parameters: {phase: [0, 1]}}\n"
        f"  b: {{block: {block}, inputs: {{{inputs}}},\n      parameters: {{{parameters}}}}}\n"
    )
    return path


@pytest.mark.parametrize(
    ("block", "parameters", "inputs", "said", "fix"),
    [
        ("TransferFunction", "denominator: []", "u: s.y", "`denominator` has an axis of 0 elements", ""),
        ("Luenberger", "A: 0.9, B: 1, C: 1, L: 0.1", "u: s.y, y: s.y", "nothing determines the", "`A: [[0.9]]`"),
        ("LinearMPC", "A: [[1]], B: [[1]], Q: [[1]], R: -1", "x: [0]", "R is symmetric, with no negative", ""),
        ("LinearMPC", "A: [[1]], B: [[1]], Q: [[-1]]", "x: [0]", "Q is symmetric, with no negative", ""),
        ("LookUp1D", "points: [0, inf], values: [0, 1]", "u: s.y", "points ascending", ""),
        ("Square", "frequency: 1.0e+20", "", "0 < frequency < 1e9 Hz", ""),
        ("TransportDelay", "T: inf", "u: s.y", "T > 0, and finite", ""),
    ],
)
def test_values_that_would_give_wrong_figures_are_refused(tmp_path, block, parameters, inputs, said, fix):
    with pytest.raises(DiagramErrors) as caught:
        run.load(_diagram(tmp_path / "d.yaml", block, parameters, inputs))
    assert said in str(caught.value) and fix in str(caught.value)
    assert "d.yaml:" in str(caught.value) and "cannot be judged" not in str(caught.value)
