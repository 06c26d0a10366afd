"""Block classes found by name: in libraries, and in Python files next to a diagram."""

import json
import os
import signal
import subprocess
import sys

import pytest

from cosim.authoring.block import Block
from cosim.errors import (
    AmbiguousBlock,
    BlockImportError,
    DeclarationError,
    DiagramErrors,
    MissingFile,
    Position,
    UnknownBlock,
    WrongValue,
)
from cosim.language.entry import BlockEntry
from cosim.language.source import Node
from cosim.machine import distributions, importing
from cosim.wiring import library

LAG = '''
from cosim import Block, Input, Parameter, State


class Lag(Block):
    """First-order lag."""

    u = Input("n")
    x = State("n", output=True)
    T = Parameter(default={T})

    def derivatives(u, x, T, d_x):
        d_x[:] = (u - x) / T
'''


def entry(kind, text, folder="", **sections):
    return BlockEntry(
        "plant", kind, Node(text, Position(f"{folder}/a.yaml", 5, 12)), Position("a.yaml", 4, 3), **sections
    )


@pytest.fixture
def libraries(tmp_path, monkeypatch):
    """A function that makes packages in the test's folder the only libraries."""
    monkeypatch.syspath_prepend(str(tmp_path))
    before = set(sys.modules)

    def make(*packages):
        points = [distributions.EntryPoint(name, name) for name in packages]
        monkeypatch.setattr(distributions, "entry_points", lambda group: points)
        library._points.cache_clear()
        library._libraries.cache_clear()

    yield make
    library._points.cache_clear()
    library._libraries.cache_clear()
    for name in set(sys.modules) - before:
        del sys.modules[name]


def package(folder, name, **modules):
    """Write a package with these modules."""
    (folder / name).mkdir()
    for module, content in {"__init__": "", **modules}.items():
        (folder / name / f"{module}.py").write_text(content)


def test_all_public_modules_of_a_library(tmp_path, libraries):
    package(tmp_path, "plants", lag=LAG.format(T=1.0), _hidden=LAG.replace("Lag", "Hidden"))
    package(tmp_path / "plants", "deep", more=LAG.format(T=2.0).replace("Lag", "Deep"))
    libraries("plants")
    assert list(library.all_blocks()) == ["Deep", "Lag"]
    assert library.all_blocks()["Lag"].__module__ == "plants.lag"
    assert library.find(entry("block", "Lag")) is library.all_blocks()["Lag"]
    assert library.broken() == []


def test_modules_that_do_not_speak_of_a_block_are_not_imported(tmp_path, libraries):
    """Nor does what is wrong with them hold anybody up; what takes all of another module may have it."""
    more = {"gain": LAG.format(T=1.0).replace("Lag", "Gain"), "broken": "1 / 0", "all": "from plants._inner import *"}
    package(tmp_path, "plants", lag=LAG.format(T=1.0), _inner=LAG.replace("Lag", "Inner").format(T=1.0), **more)
    libraries("plants")
    library.find(entry("block", "Lag"))
    assert {"plants.lag", "plants.all"} <= set(sys.modules) and "plants.gain" not in sys.modules
    assert library.find(entry("block", "Inner")).__module__ == "plants._inner"
    with pytest.raises(DiagramErrors) as caught:
        library.find(entry("block", "Gains"))
    assert [type(error) for error in caught.value.errors] == [UnknownBlock, BlockImportError]
    assert "plants.gain" in sys.modules and caught.value.errors[0].fix == "did you mean `Gain`?"


def test_a_class_that_is_imported_elsewhere_counts_once(tmp_path, libraries):
    package(tmp_path, "plants", lag=LAG.format(T=1.0), again="from plants.lag import Lag\n_Private = Lag\n")
    libraries("plants")
    assert issubclass(library.find(entry("block", "Lag")), Block)


def test_unknown_block_has_the_nearest_name_and_the_place(tmp_path, libraries):
    package(tmp_path, "plants", lag=LAG.format(T=1.0))
    libraries("plants")
    with pytest.raises(UnknownBlock) as caught:
        library.find(entry("block", "Lagg"))
    assert caught.value.position == Position("/a.yaml", 5, 12)
    assert caught.value.message == "block `plant`: there is no block type `Lagg`"
    assert caught.value.fix == "did you mean `Lag`?"


def test_a_name_in_two_modules(tmp_path, libraries):
    package(tmp_path, "plants", lag=LAG.format(T=1.0), other=LAG.format(T=2.0))
    libraries("plants")
    with pytest.raises(AmbiguousBlock) as caught:
        library.find(entry("block", "Lag"))
    assert "plants.lag and plants.other" in caught.value.message
    assert caught.value.position.line == 5


def test_a_broken_module_harms_only_what_it_may_have(tmp_path, libraries, monkeypatch):
    monkeypatch.chdir(tmp_path)
    package(
        tmp_path, "plants", lag=LAG.format(T=1.0), broken="x = 1\ny = x +\n", wrong="\n\nimport nothing_like_this\n"
    )
    libraries("plants")
    assert library.find(entry("block", "Lag")).__name__ == "Lag"
    assert [(type(e), e.position.file, e.position.line) for e in library.broken()] == [
        (BlockImportError, "plants/broken.py", 2),
        (BlockImportError, "plants/wrong.py", 3),
    ]
    with pytest.raises(DiagramErrors) as caught:
        library.find(entry("block", "Observer"))
    assert [type(e) for e in caught.value.errors] == [UnknownBlock, BlockImportError, BlockImportError]


def test_a_library_that_is_not_there(libraries):
    libraries("no_such_package_anywhere")
    (error,) = library.broken()
    assert isinstance(error, BlockImportError)
    assert "no_such_package_anywhere" in str(error)


def test_a_python_file_next_to_the_diagram(tmp_path):
    (tmp_path / "mine.py").write_text("from gains import T\n" + LAG.format(T="T"))
    (tmp_path / "gains.py").write_text("T = 7.0\n")
    path = list(sys.path)
    block = library.find(entry("python", "mine.py:Lag", tmp_path))
    assert block.declaration.variables["T"].start == 7.0
    assert sys.path == path
    assert "gains" not in sys.modules
    assert library.find(entry("python", "mine.py:Lag", tmp_path)) is block
    assert not (tmp_path / "__pycache__" / "mine.pyc").exists()


def test_siblings_of_one_name_in_two_folders_are_two_modules(tmp_path):
    starts = []
    for folder, gain in ((tmp_path / "one", 1.0), (tmp_path / "two", 2.0)):
        folder.mkdir()
        (folder / "mine.py").write_text("from gains import T\n" + LAG.format(T="T"))
        (folder / "gains.py").write_text(f"T = {gain}\n")
        starts.append(library.find(entry("python", "mine.py:Lag", folder)).declaration.variables["T"].start)
    assert starts == [1.0, 2.0]


def test_what_others_find_too_stays_imported(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "mine.py").write_text("import a_sibling_that_all_find\n" + LAG.format(T=1.0))
    (tmp_path / "a_sibling_that_all_find.py").write_text("")
    library.find(entry("python", "mine.py:Lag", tmp_path))
    assert "a_sibling_that_all_find" in sys.modules
    del sys.modules["a_sibling_that_all_find"]


def test_a_changed_file_is_imported_again(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(LAG.format(T=1.0))
    first = library.find(entry("python", "mine.py:Lag", tmp_path))
    file.write_text(LAG.format(T=2.0))
    second = library.find(entry("python", "mine.py:Lag", tmp_path))
    assert (first.declaration.variables["T"].start, second.declaration.variables["T"].start) == (1.0, 2.0)
    assert first.__module__ == second.__module__
    assert sys.modules[second.__module__].Lag is second


@pytest.mark.parametrize(
    ("content", "error", "line", "words"),
    [
        ("x = 1\ny = = 2\n", BlockImportError, 2, "invalid syntax"),
        ("def f():\n    return 1 / 0\n\n\nf()\n", BlockImportError, 2, "ZeroDivisionError: division by zero"),
        ("\nimport nothing_like_this\n", BlockImportError, 2, "nothing_like_this"),
        ("import sys\nsys.exit(3)\n", BlockImportError, 2, "SystemExit"),
        ("x = '\0'\n", BlockImportError, 0, "null bytes"),
        (LAG.format(T=1.0).replace("T, d_x)", "T, xx, d_x)"), DeclarationError, 12, "`xx`"),
    ],
)
def test_mistakes_in_a_python_file(tmp_path, content, error, line, words):
    (tmp_path / "mine.py").write_text(content)
    with pytest.raises(error) as caught:
        library.find(entry("python", "mine.py:Lag", tmp_path))
    assert (caught.value.position.file, caught.value.position.line) == (str(tmp_path / "mine.py"), line)
    assert words in caught.value.message
    assert caught.value.fix
    assert not [
        name for name in sys.modules if name.startswith("cosim_file_mine") and str(tmp_path) in str(sys.modules[name])
    ]


@pytest.mark.parametrize(
    ("line", "fix"),
    [("from blocks.gains import T", "of its own folder"), ("from .gains import T", "leave out the dot")],
)
def test_imports_that_a_file_of_blocks_does_not_have(tmp_path, line, fix):
    (tmp_path / "mine.py").write_text(f"{line}\n{LAG.format(T=1.0)}")
    (tmp_path / "gains.py").write_text("T = 7.0\n")
    with pytest.raises(BlockImportError) as caught:
        library.find(entry("python", "mine.py:Lag", tmp_path))
    assert fix in caught.value.fix and caught.value.position.line == 1


def test_a_mistake_in_a_sibling_is_placed_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text("import gains\n")
    (tmp_path / "gains.py").write_text("\n\nT = S\n")
    with pytest.raises(BlockImportError) as caught:
        library.find(entry("python", "mine.py:Lag", tmp_path))
    assert (caught.value.position.file, caught.value.position.line) == ("gains.py", 3)
    assert "gains" not in sys.modules


def test_a_class_that_the_file_does_not_have(tmp_path):
    (tmp_path / "mine.py").write_text(LAG.format(T=1.0))
    with pytest.raises(UnknownBlock) as caught:
        library.find(entry("python", "mine.py:Leg", tmp_path))
    assert caught.value.fix == "did you mean `Lag`?"
    assert caught.value.position.line == 5
    (tmp_path / "none.py").write_text("class Lag: pass\n")
    with pytest.raises(UnknownBlock) as caught:
        library.find(entry("python", "none.py:Lag", tmp_path))
    assert caught.value.fix == "derive a class from cosim.authoring.block.Block"


def test_a_missing_python_file(tmp_path):
    (tmp_path / "mine.py").write_text("")
    with pytest.raises(MissingFile) as caught:
        library.find(entry("python", "mien.py:Lag", tmp_path))
    assert caught.value.position.line == 5
    assert caught.value.fix == "did you mean `mine.py`?"


@pytest.mark.parametrize("text", ["mine.py", "mine.py:", "Lag", "mine.txt:Lag"])
def test_a_type_without_file_and_class(tmp_path, text):
    with pytest.raises(WrongValue) as caught:
        library.find(entry("python", text, tmp_path))
    assert caught.value.fix == "write python: file.py:ClassName"


def test_the_blocks_of_the_repository_are_found():
    library._points.cache_clear()
    library._libraries.cache_clear()
    assert library.all_blocks()
    assert library.broken() == []


BLOCK_FILE = LAG.format(T=1.0)


def test_what_a_file_prints_while_it_is_imported_goes_to_standard_error(tmp_path):
    text = "import os, subprocess, sys\nprint('uno')\nsubprocess.run([sys.executable, '-c', 'print(\"duo\")'])\n"
    (tmp_path / "mine.py").write_text(text + "os.write(1, b'tres')\n" + BLOCK_FILE)
    (tmp_path / "d.yaml").write_text(
        "run: {stop: 0.1, step: 0.1}\nblocks:\n  a: {python: 'mine.py:Lag', start: {u: 0}}\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "cosim.terminal.cli", "run", "d.yaml", "--json", "--engine", "python"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2 or json.loads(done.stdout)["status"] == "completed", done.stderr
    assert not {"uno", "duo", "tres"} & set(done.stdout.split()) and len(done.stdout.splitlines()) == 1
    assert all(word in done.stderr for word in ("uno", "duo", "tres"))


@pytest.mark.parametrize("leave", ["os._exit(0)", "posix._exit(0)", "sys.exit(0)", "quit()", "raise SystemExit"])
def test_a_file_that_would_end_the_process_is_an_error(tmp_path, leave):
    (tmp_path / "mine.py").write_text(f"import os, sys\nimport {os.name} as posix\n\n{leave}\n{BLOCK_FILE}")
    before = os._exit
    with pytest.raises(BlockImportError) as caught:
        library.find(entry("python", "mine.py:Lag", tmp_path))
    assert (caught.value.position.file, caught.value.position.line) == (str(tmp_path / "mine.py"), 4)
    assert os._exit is before


def test_a_child_that_an_import_forks_may_end(tmp_path):
    text = "import os\nchild = os.fork()\nif child == 0:\n    os._exit(7)\nstatus = os.waitpid(child, 0)[1]\n"
    (tmp_path / "mine.py").write_text(text + "assert os.waitstatus_to_exitcode(status) == 7\n" + BLOCK_FILE)
    assert library.find(entry("python", "mine.py:Lag", tmp_path)).__name__ == "Lag"


@pytest.mark.parametrize(
    "body",
    [
        "while True:\n    pass\n",
        "import threading\nlock = threading.Lock()\nlock.acquire()\nlock.acquire()\n",
        "import time\n\n\ndef wait():\n    time.sleep(1e6)\n\n\nwait()\n",
        "while True:\n    try:\n        while True:\n            pass\n    except Exception:\n        pass\n",
    ],
)
def test_an_import_that_does_not_end_is_told_where_it_is(tmp_path, monkeypatch, body):
    monkeypatch.setattr(importing, "PATIENCE", 0.2)
    (tmp_path / "mine.py").write_text(body)
    handler = signal.getsignal(signal.SIGALRM)
    with pytest.raises(BlockImportError, match=r"does not come to an end within 0\.2 s") as caught:
        library.find(entry("python", "mine.py:Lag", tmp_path))
    place = caught.value.position
    assert place.file == str(tmp_path / "mine.py") and 0 < place.line <= len(body.splitlines())
    assert signal.getsignal(signal.SIGALRM) is handler and signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_an_import_that_nothing_ends_ends_the_process(tmp_path):
    loop = "while True:\n    try:\n        while True:\n            pass\n    except BaseException:\n        pass\n"
    (tmp_path / "mine.py").write_text(loop)
    program = "from cosim.machine import importing; from cosim.terminal import cli; "
    program += "importing.PATIENCE = 0.1; importing.AGAIN = 0.05; cli.main(['blocks', 'mine.py:Lag'])"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 2 and "the import of `mine.py` does not end" in done.stderr


def test_all_mistakes_of_a_file_with_those_of_its_sibling(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = BLOCK_FILE.replace("d_x[:] = (u - x) / T", "return x")
    (tmp_path / "sibling.py").write_text(wrong.replace("Lag", "Other"))
    (tmp_path / "mine.py").write_text("from sibling import Other\n" + wrong + "\n\n1 / 0\n")
    with pytest.raises(DiagramErrors) as caught:
        library.find(entry("python", "mine.py:Lag", tmp_path))
    places = [(e.position.file, e.position.line) for e in caught.value.errors]
    assert places == [("mine.py", 13), ("mine.py", 14), ("mine.py", 17), ("sibling.py", 12), ("sibling.py", 13)]


def test_a_library_with_mistakes_in_a_declaration(tmp_path, libraries, monkeypatch):
    monkeypatch.chdir(tmp_path)
    both = BLOCK_FILE.replace("T = ", "time = ").replace("T, d_x)", "tt, d_x)")
    package(tmp_path, "plants", lag=BLOCK_FILE, wrong=both.replace("Lag", "Wrong"))
    libraries("plants")
    assert list(library.all_blocks()) == ["Lag"]
    assert [(e.position.file, e.position.line) for e in library.broken()] == [
        ("plants/wrong.py", 10),
        ("plants/wrong.py", 12),
    ]
