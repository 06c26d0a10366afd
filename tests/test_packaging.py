"""Where the library's blocks are found: beside `cosim` in a source tree, within it when installed; never `blocks`."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import cosim.blocks

ROOT = Path(__file__).parents[1]
FOUND = """
import os, sys
from cosim.wiring import library
for folder in {os.path.dirname(sys.modules[block.__module__].__file__) for block in library.all_blocks().values()}:
    print(folder)
import cosim.blocks
print(os.path.dirname(cosim.blocks.__file__))
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


def test_a_copy_of_the_source_tree_has_blocks_of_its_own(tmp_path):
    for name in ("cosim", "blocks"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    assert told(tmp_path, FOUND) == 2 * [str(tmp_path / "blocks")]


@pytest.fixture
def installed(user, tmp_path):
    """A folder of a test's own that holds the package as a wheel does."""
    shutil.copytree(next(user.glob("lib/python*/site-packages/cosim")), tmp_path / "site" / "cosim")
    return tmp_path / "site"


def test_an_installed_package_has_its_blocks_within_and_looks_nowhere_else(installed):
    (installed / "blocks").mkdir()
    (installed / "blocks" / "__init__.py").write_text("raise RuntimeError('not ours')")
    code = "import cosim, cosim.blocks.controller as c; print(c.__file__); print(len(cosim.__path__))"
    assert told(installed, code) == [str(installed / "cosim" / "blocks" / "controller.py"), "1"]


def test_a_wheel_holds_every_file_of_the_package_and_every_diagram(installed):
    files = [path for path in (ROOT / "cosim").rglob("*") if path.is_file() and path.suffix != ".pyc"]
    files += (ROOT / "blocks").glob("*.py")
    files += [path for path in (ROOT / "diagrams").rglob("*.yaml") if "results" not in path.parts]
    wanted = {str(path.relative_to(ROOT)) for path in files}
    held = {str(path.relative_to(installed / "cosim")) for path in (installed / "cosim").rglob("*")}
    assert {name for name in wanted if name.removeprefix("cosim/") not in held} == set()


def test_a_folder_called_blocks_beside_a_file_of_blocks_is_in_nobodys_way(installed, tmp_path):
    (tmp_path / "blocks").mkdir()
    (tmp_path / "blocks" / "mine.py").write_text("FACTOR = 3.0\n")
    own = tmp_path / "own.py"
    own.write_text("from blocks.mine import FACTOR\nfrom cosim.blocks.cube_root import cube_root\n")
    code = "from pathlib import Path; from cosim.wiring.block_files import import_file; "
    code += f"m = import_file(Path({str(own)!r})); "
    assert told(installed, code + "print(m.cube_root(9.0 * m.FACTOR))") == ["3.0"]


def test_the_environment_of_a_user_knows_no_clone(user):
    shown = "cosim.__file__, cosim.results.__file__, *sys.path"
    code = f"import cosim, cosim.results, cosim.blocks, sys; print({shown}, sep='\\n')"
    done = subprocess.run([user / "bin" / "python", "-I", "-c", code], capture_output=True, text=True, check=True)
    package, results, *path = done.stdout.splitlines()
    assert all(Path(file).is_relative_to(user) for file in (package, results))
    assert str(ROOT) not in path  # the tests' own environment, with what cosim needs, may lie in it
