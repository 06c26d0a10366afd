"""What `cosim check` says of a diagram's functions."""

import pytest

from cosim.terminal.cli import main

BLOCKS = '''
import math
from cosim import Block, Output, Parameter

class Wave(Block):
    """y = sin(w t), and a whole number of turns."""
    w = Parameter(default=1.0)
    y = Output()
    turns = Output()
    def outputs_wave(time, w, y):
        y[0] = math.sin(w * time)
    def outputs_turns(time, w, turns):
        turns[0] = w * time
'''
DIAGRAM = """
run: {stop: 1, step: 0.1}
fleets: {ship: SHIPS}
blocks:
  wave: {python: waves.py:Wave, per: ship}
  lone: {python: waves.py:Wave}
"""


@pytest.mark.parametrize(("ships", "told"), [(3, True), (2, False)])
def test_check_says_which_functions_of_a_fleet_are_done_eight_at_a_time(tmp_path, capsys, ships, told):
    """From three members on; a lone block has none."""
    (tmp_path / "waves.py").write_text(BLOCKS)
    (tmp_path / "d.yaml").write_text(DIAGRAM.replace("SHIPS", str(ships)))
    assert main(["check", str(tmp_path / "d.yaml")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert ("for eight members of a fleet at a time: wave.outputs_wave" in lines) == told
    assert any(line.startswith("for one member after the other, as it computes no exp") for line in lines) == told
    assert not any("lone.outputs" in line for line in lines if line.startswith("for "))
