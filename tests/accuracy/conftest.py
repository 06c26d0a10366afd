"""Fixtures: certificates of diagrams that a test writes."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from cosim.accuracy import certificate
from cosim.accuracy.refined_runs import RefinedRuns
from cosim.engine import run

BLOCKS = Path(__file__).with_name("known_blocks.py")


@pytest.fixture
def diagram(tmp_path):
    """Write a diagram whose block types are those of `known_blocks.py` (`type: Decay`)."""

    def write(text: str, name: str = "diagram.yaml") -> Path:
        path = tmp_path / name
        path.write_text(textwrap.dedent(text).replace("type: ", f"python: {BLOCKS}:"), encoding="utf-8")
        return path

    return write


@pytest.fixture
def refined(tmp_path):
    """The runs of a diagram, whose signals are recorded."""

    def make(path: Path, *settings: str, engine: str = "native") -> RefinedRuns:
        network = run.load(path, settings)
        folder = tmp_path / "runs"
        folder.mkdir(exist_ok=True)
        where = folder if network.recorded else None
        return RefinedRuns(network, lambda more: run.load(path, [*settings, *more]), engine, where)

    return make


@pytest.fixture
def certified(diagram, refined):
    """The certificate of a diagram."""

    def certify(text: str, *settings: str, engine: str = "native", wanted: certificate.Wanted | None = None):
        return certificate.certify(refined(diagram(text), *settings, engine=engine), wanted)

    return certify
