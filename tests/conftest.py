"""Fixtures: diagrams written in a test, wired, run by either engine."""

from __future__ import annotations

import shutil
import signal
import site
import subprocess
import sys
import sysconfig
import textwrap
import venv
import zipfile
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from cosim.compiling import kernels
from cosim.engine import compilation, loop_code, program, run
from cosim.engine.probes import Probes
from cosim.engine.simulation import Simulation
from cosim.machine import cache
from cosim.terminal import cli
from cosim.wiring.network import Network, Signal

# The same examples at every run: a test that fails here fails everywhere. `--hypothesis-profile search` draws new ones.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("search", deadline=None)
settings.load_profile("repeatable")

# A shell starts what it runs in the background deaf to Ctrl-C, and a program that is started so stays so.
for _number in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)):
    if signal.getsignal(_number) == signal.SIG_IGN:
        signal.signal(_number, signal.default_int_handler if _number == signal.SIGINT else signal.SIG_DFL)

BLOCKS = Path(__file__).with_name("signal_blocks.py")
ROOT = Path(__file__).parents[1]
PACKED = ("cosim", "blocks", "diagrams", "pyproject.toml", "setup.py", "README.md", "LICENSE")
"""What a wheel is built of."""


@pytest.fixture(scope="session")
def user(tmp_path_factory) -> Path:
    """The environment of somebody who has installed a wheel of this tree, and has no clone.

    What cosim needs is that of the tests, whose folder is on the path; an editable installation there is not followed.
    """
    folder = tmp_path_factory.mktemp("user")
    ignored = shutil.ignore_patterns("__pycache__", "*.nc")
    for name in PACKED:
        copy = partial(shutil.copytree, ignore=ignored) if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / name)
    build = "from setuptools import build_meta; build_meta.build_wheel('.')"
    subprocess.run([sys.executable, "-c", build], cwd=folder, capture_output=True, check=True)
    venv.create(folder / "venv", symlinks=True)
    packages = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder / "venv")}))
    with zipfile.ZipFile(next(folder.glob("*.whl"))) as wheel:
        wheel.extractall(packages)
    (packages / "needed.pth").write_text("\n".join(site.getsitepackages()))
    command = folder / "venv" / "bin" / "cosim"
    command.write_text(f'#!/bin/sh\nexec "{command.parent}/python" -m cosim "$@"\n')
    command.chmod(0o755)
    return folder / "venv"


@pytest.fixture(scope="session")
def loop_entry() -> tuple[str, bytes]:
    """What the cache of compiled code has of the loop: a name, and code."""
    module = kernels.module(loop_code.whole_loop())
    return f"{module.name}-{module.key}", module.code


@pytest.fixture
def new_cache(loop_entry, tmp_path, monkeypatch) -> Path:
    """A cache of the test's own that has the loop alone, which takes longer to compile than a diagram's blocks."""
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "cache"))
    cache.write(*loop_entry)
    return tmp_path / "cache"


@pytest.fixture
def write(tmp_path):
    """Write a diagram whose block types are those of `signal_blocks.py` (`python: Gain` for short)."""

    def write_text(text: str, name: str = "diagram.yaml") -> Path:
        path = tmp_path / name
        lines = textwrap.dedent(text).replace("type: ", f"python: {BLOCKS}:")
        path.write_text(lines, encoding="utf-8")
        return path

    return write_text


@pytest.fixture
def cosim(tmp_path, monkeypatch, capsys):
    """Run the command line in an empty folder: (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: object) -> tuple[int, str, str]:
        code = cli.main([str(a) for a in arguments])
        return code, *capsys.readouterr()

    return call


@pytest.fixture
def wired(write):
    """Write and wire a diagram."""

    def wire(text: str, *settings: str, swaps: tuple[str, ...] = ()) -> Network:
        return run.load(write(text), settings, swaps)

    return wire


@pytest.fixture
def trajectories():
    """Run a network and return its signals at every step: {name: array (steps + 1, *shape)}."""

    def trajectory(network: Network, *names: str, method: str | None = None, engine: str = "native"):
        built = program.build(network, method or network.diagram.run.method)
        signals = tuple(Signal(*name.rsplit(".", 1)) for name in names)
        compiled = compilation.compile_program(built) if engine == "native" else None
        one = Simulation(built, compiled, [Probes(signals)])
        one.initialize()
        parts: dict[str, list[np.ndarray]] = {name: [] for name in names}
        for (samples,) in one.batches():
            for name, probed in zip(names, signals, strict=True):
                parts[name].append(samples.values[probed].copy())
        return {name: np.concatenate(arrays) for name, arrays in parts.items()}

    return trajectory


@pytest.fixture
def formation() -> Path:
    """The paper's formation."""
    return Path(__file__).parents[1] / "diagrams" / "formation.yaml"
