"""How sure a run is that a block ends, at a time that depends on the step."""

from __future__ import annotations

import json
import math

import pytest

from cosim.terminal import cli
from tests.engine.test_block_endings import BLOCKS, FALL, stone


@pytest.mark.parametrize("period", [0.01, 0.05])
def test_errors_of_a_fall_to_the_ground(tmp_path, capfd, period):
    """Euler's method loses g t h / 2 of the way; the speed is that of a fall that ends h / 2 too late."""
    (tmp_path / "own.py").write_text(BLOCKS)
    path = tmp_path / "d.yaml"
    path.write_text(stone(period=period).replace("heun", "euler"))
    assert cli.main(["accuracy", str(path), "--json"]) == 0
    told = json.loads(capfd.readouterr().out)
    assert any("the runs are ended at 0.4565" in note for note in told["notes"])
    assert 0.3 < told["signals"]["s.h"]["error"] / (9.81 * 0.45 * 0.005) < 3
    speed = told["metrics"]["speed"]
    value = speed["values"][0]
    assert 0.3 < speed["error"] / abs(value + 9.81 * FALL) < 3
    assert math.isfinite(told["signals"]["way.x"]["error"])
