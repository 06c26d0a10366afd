"""Fixtures: a small study of a fleet of lags, and how to run it."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from cosim.study import running, study_file
from cosim.study.running import Options, Results

BLOCKS = Path(__file__).parents[1] / "signal_blocks.py"
DIAGRAM = """
    run: {stop: 1, step: 0.01}
    fleets: {robot: 3}
    blocks:
      source: {type: Sine, per: robot}
      lag: {type: Lag, per: robot, parameters: {T: 0.5}, start: {x: [[0, 0], [1, 1], [2, 2]]}, inputs: {u: source.y}}
      swing: {type: Oscillator, parameters: {w: 2}}
    record: {period: 0.1, signals: [lag.x, swing.x]}
    metrics:
      top: {signal: lag.x, reduce: max}
      last: {signal: swing.x, reduce: final}
      low: {signal: swing.x, reduce: min}
    """
STUDY = """
    diagram: diagram.yaml
    variants:
      plain:
      slow: {set: {blocks.lag.parameters.T: 2}}
    grid:
      blocks.swing.parameters.w: [1, 2, 3]
    random:
      count: 4
      seed: 5
      draws:
        blocks.lag.start.x: {uniform: [-1, 1]}
    """


def written(folder: Path, text: str, name: str) -> Path:
    """A file of a test; `type: X` is a block of `signal_blocks.py`."""
    path = folder / name
    path.write_text(textwrap.dedent(text).replace("type: ", f"python: {BLOCKS}:"), encoding="utf-8")
    return path


@pytest.fixture
def study(tmp_path):
    """Write a diagram and a study, and load the study."""

    def load(text: str = STUDY, diagram: str = DIAGRAM, settings: tuple[str, ...] = ()):
        written(tmp_path, diagram, "diagram.yaml")
        return study_file.load(written(tmp_path, text, "study.yaml"), settings)

    return load


@pytest.fixture
def results(study, tmp_path):
    """Write, load and run a study."""

    def run(text: str = STUDY, diagram: str = DIAGRAM, **options) -> Results:
        return running.run(study(text, diagram), Options(tmp_path / "results", **options))

    return run
