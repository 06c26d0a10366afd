"""Where the library's blocks are found: beside `cosim` in a source tree, within it when installed; never `blocks`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import cosim.blocks
from cosim import run

ROOT = Path(__file__).parents[1]
FOUND = """
import sys
from cosim import library
print({sys.modules[block.__module__].__file__.rpartition("/")[0] for block in library.all_blocks().values()})
import cosim
print(cosim.blocks.__file__.rpartition("/")[0])
"""


def told(path: Path, code: str) -> list[str]:
    """The lines that a process prints that finds `path` before all else."""
    environment = {**os.environ, "PYTHONPATH": str(path), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=path, capture_output=True, text=True, check=True
    )
    return done.stdout.splitlines()


def test_the_source_tree_has_its_blocks_at_the_top():
    assert Path(cosim.blocks.__file__) == ROOT / "blocks" / "__init__.py"


@pytest.mark.skipif(os.name != "posix", reason="the process prints paths as POSIX has them")
def test_a_copy_of_the_source_tree_has_blocks_of_its_own(tmp_path):
    for name in ("cosim", "blocks"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    assert told(tmp_path, FOUND) == [str({str(tmp_path / "blocks")}), str(tmp_path / "blocks")]


@pytest.mark.skipif(os.name != "posix", reason="the process prints paths as POSIX has them")
def test_an_installed_package_has_its_blocks_within_and_looks_nowhere_else(tmp_path):
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "cosim", tmp_path / "cosim", ignore=ignore)
    shutil.copytree(ROOT / "blocks", tmp_path / "cosim" / "blocks", ignore=ignore)
    (tmp_path / "blocks").mkdir()
    (tmp_path / "blocks" / "__init__.py").write_text("raise RuntimeError('not ours')")
    code = "import cosim, cosim.blocks.controller as c; print(c.__file__); print(len(cosim.__path__))"
    assert told(tmp_path, code) == [str(tmp_path / "cosim" / "blocks" / "controller.py"), "1"]


def test_a_folder_called_blocks_beside_a_diagram_is_in_nobodys_way(tmp_path):
    (tmp_path / "blocks").mkdir()
    (tmp_path / "blocks" / "mine.py").write_text("FACTOR = 3.0\n")
    (tmp_path / "own.py").write_text(
        "from blocks.mine import FACTOR\nfrom cosim import Block, Output\n"
        "from cosim.blocks.cube_root import cube_root\n"
        "class Three(Block):\n    y = Output()\n    def outputs(y):\n        y[0] = cube_root(FACTOR * 9.0)\n"
    )
    (tmp_path / "d.yaml").write_text(
        "run: {stop: 1, step: 0.5}\nblocks:\n  three: {python: own.py:Three}\n  path: {block: SineWavePath}\n"
        "metrics: {y: {signal: three.y, reduce: max}}\n"
    )
    outcome = run.Run(run.load(tmp_path / "d.yaml"), engine="python").execute()
    assert outcome.metrics["y"] == pytest.approx(3.0)
