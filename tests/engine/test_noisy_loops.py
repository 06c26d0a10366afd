"""Algebraic loops whose unknown is far smaller than what is added up inside a block, where no slope shows its rounding.

With constants that make the solution known, the error is that of the block's arithmetic over |1 - f'|, of which sixteen
standard deviations are allowed; and what has no solution is none of this, however small its residual.
"""

from __future__ import annotations

import math

import pytest

from cosim.engine import program, run
from cosim.engine.simulation import Simulation
from cosim.errors import BlockFailed
from cosim.wiring.network import Signal

EPSILON = 2.0**-52


@pytest.fixture
def solved(tmp_path):
    """The y that is f(y), of a block beside one that hands on. Raises: BlockFailed."""

    def solve(text: str, start: float = 0.0) -> float:
        (tmp_path / "d.yaml").write_text(
            f"""
run: {{stop: 0.1, step: 0.1}}
blocks:
  f: {{expression: "{text}", inputs: {{u: same.y}}}}
  same: {{expression: "u", inputs: {{u: f.y}}, start: {{y: {start}}}}}
"""
        )
        built = program.build(run.load(tmp_path / "d.yaml"), "jacobi")
        one = Simulation(built, None, [])
        one.initialize()
        return float(built.signal(Signal("f", "y"), one.arena))

    return solve


@pytest.mark.parametrize("y", [0.0, 1e-12, -1.9e-8, 1.4e-4])
@pytest.mark.parametrize("slope", [-2.98, -0.5, 0.457, 0.88, 4.1])
@pytest.mark.parametrize("size", [1.0, 10.0])
def test_the_difference_of_large_numbers(solved, y, slope, size):
    constant = size + (1.0 - slope) * y  # rounded, as the sum inside is
    found = solved(f"({slope!r}*u + {constant!r}) - {size!r}")
    assert found == pytest.approx(y, rel=1e-12, abs=16.0 * EPSILON * size / abs(1.0 - slope))


@pytest.mark.parametrize("y", [0.0, 1e-12, -1.9e-8, 8e-5])
@pytest.mark.parametrize("slope", [-2.98, -0.5, 0.457, 0.88, 4.1])
def test_a_cosine_near_its_zero(solved, y, slope):
    """y = cos(a y + b) with b = acos(y) - a y, a number near pi/2, of which half a unit in the last place is 1e-16."""
    a = -slope / math.sqrt(1.0 - y * y)
    found = solved(f"cos({a!r}*u + {math.acos(y) - a * y!r})")
    assert found == pytest.approx(y, rel=1e-12, abs=16.0 * EPSILON / abs(1.0 - slope))


@pytest.mark.parametrize("text", ["u + 1e12*u*u + 1e-14", "u + 1e-14*exp(u)"])
def test_a_small_residual_is_no_solution(solved, text):
    """f(y) - y is 1e-14 at least, and smooth."""
    with pytest.raises(BlockFailed, match=r"no solution was found|undetermined"):
        solved(text)


@pytest.mark.parametrize(
    "text",
    [
        "u + 6.089040941128142e-14*(2 + sin(255376416375474.03*u))",
        "u + 1.5e-12*(1.1 + floor(u/1.5e-12) - u/1.5e-12)",
        "u + 1.4687613153819906e-12*(2 + sin(88326765876308.3*u))",
    ],
)
@pytest.mark.parametrize("start", [1.0, 0.1, -1.7])
def test_noise_determines_nothing(solved, text, start):
    """f(y) - y is nowhere zero, and 1 - f' is, but for the slopes of noise."""
    with pytest.raises(BlockFailed, match=r"no solution was found|undetermined"):
        solved(text, start)


@pytest.mark.parametrize("step", [2.5e-12, 3.4447312897688287e-12, 6e-12])
def test_what_noise_may_leave_is_a_part_of_the_nominal_value(solved, step):
    """f has no values but multiples of a step, and is nowhere nearer to y than 0.46 steps, more than 1e-12."""
    with pytest.raises(BlockFailed, match="no solution was found"):
        solved(f"floor((-3*u + 2.6*{step})/{step})*{step}", 1e-12)


@pytest.mark.parametrize("jump", [2e-14, 1e-13, 4e-13, 2e-12])
@pytest.mark.parametrize("slope", [0.5, -2.0])
@pytest.mark.parametrize("start", [0.0, 2.0])
def test_a_jump_over_the_solution_is_no_noise(solved, jump, slope, start):
    """f(y) - y is a jump at least, of one sign below 1 and of the other above; noise would be on both sides of y."""
    with pytest.raises(BlockFailed, match=r"no solution was found|undetermined"):
        solved(f"{slope!r}*(u - 1) + 1 + if(u < 1, {jump!r}, {-jump!r})", start)


@pytest.mark.parametrize("size", [1.0, 1e-14, 1e-20])
@pytest.mark.parametrize(
    ("a", "b", "c", "start"),
    [
        (8.621255260363016, -0.4082475027640492, 4.451586943610058, 0.0),
        (-2.162905750145546, 0.8709407240917185, -0.9382840754393206, 0.0),
        (1.020631216152106, -1.145633460233184, 4.656761514462673, 0.0),
        (-4.532208509425964, 1.626725701803653, -0.31242200531969, -2.2),
    ],
)
def test_a_curve_is_no_noise_however_small(solved, a, b, c, start, size):
    """y = a y^2 + b y + c, in units of a size, with (b - 1)^2 < 4 a c: no solution is real."""
    with pytest.raises(BlockFailed, match=r"no solution was found|undetermined"):
        solved(f"{size!r}*({a!r}*(u/{size!r})**2 + {b!r}*u/{size!r} + {c!r})", start * size)


@pytest.mark.parametrize("size", [1e-15, 1e-20])
@pytest.mark.parametrize("start", [0.0, -1.5])
@pytest.mark.parametrize(
    ("a", "b", "c"),
    [(-5.988846710700776, 8.97159875395759, 8.240193403959678), (4.2, -1.944, 3.296), (3.81, 3.947, -1.4)],
)
def test_a_hard_curve_is_solved_or_not_told(solved, a, b, c, size, start):
    """y = a cos(b y) + c, in units of a size, has solutions; y is f(z) for a z as exact as sums and slopes are."""
    try:
        y = solved(f"{size!r}*({a!r}*cos({b!r}*u/{size!r}) + {c!r})", start * size) / size
    except BlockFailed:
        return
    slope, added = abs(a * b), abs(a) + abs(c)
    assert a * math.cos(b * y) + c == pytest.approx(y, rel=0.0, abs=16.0 * EPSILON * slope * (added + slope * abs(y)))
