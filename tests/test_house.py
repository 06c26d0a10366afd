"""The house: imports run down, without a circle or a high tower; only the terminal prints; nothing is long."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
#: From the ground up. A floor may import what stands to its left. `__main__` and the face are the doorstep.
FLOORS = (
    "errors",
    "integrators",
    "machine",
    "plain_math",
    "master",
    "language",
    "authoring",
    "results",
    "compiling",
    "plot",
    "fmu",
    "requirements",
    "wiring",
    "engine",
    "tracing",
    "profiling",
    "study",
    "accuracy",
    "search",
    "export",
    "drawing",
    "report",
    "project",
    "face",
    "editor",
    "watch",
    "terminal",
)
DOORSTEP = ("cosim", "cosim.__main__")
HIGHEST = 10


def modules() -> dict[str, Path]:
    """All modules of the package, by dotted name."""
    paths = (ROOT / "cosim").rglob("*.py")
    names = {".".join(p.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): p for p in paths}
    assert len(names) > 100
    return names


MODULES = modules()


def imported(name: str) -> Iterator[str]:
    """The modules of the package that a module imports, at its top or inside functions."""
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, f"{name}: a relative import"
            found = {f"{node.module}.{alias.name}" for alias in node.names} & MODULES.keys()
            yield from found or {str(node.module)} & MODULES.keys()
        elif isinstance(node, ast.Import):
            yield from {alias.name for alias in node.names} & MODULES.keys()


GRAPH = {name: set(imported(name)) for name in MODULES if name not in DOORSTEP}


def floor(name: str) -> str:
    return name.split(".")[1]


def test_every_file_stands_on_a_floor():
    assert {floor(name) for name in GRAPH} == set(FLOORS)


def test_nothing_imports_the_face():
    """It serves programs and authors; `cosim.blocks` apart, which are authors' files."""
    assert {name for name, found in GRAPH.items() if "cosim" in found} <= {"cosim.terminal.cli"}  # for its version


def test_imports_run_down_only():
    up = [
        (name, other)
        for name, found in GRAPH.items()
        for other in found - {"cosim"}
        if FLOORS.index(floor(other)) > FLOORS.index(floor(name))
    ]
    assert up == []


def test_no_circle_and_no_high_tower():
    """Neither of folders nor of the files in one."""

    @cache
    def height(name: str) -> int:
        inside = {other for other in GRAPH[name] - {"cosim"} if floor(other) == floor(name) and other != name}
        return 1 + max(map(height, inside), default=0)  # a circle would be a RecursionError

    @cache
    def stands_on(folder: str) -> int:
        below = {floor(o) for n in GRAPH if floor(n) == folder for o in GRAPH[n] - {"cosim"}} - {folder}
        return 1 + max(map(stands_on, below), default=0)

    assert max(map(height, GRAPH)) <= HIGHEST
    assert max(map(stands_on, FLOORS)) <= HIGHEST


def test_only_the_terminal_prints():
    """`print`, and writing to a standard stream, is the terminal's; `streams` and `importing` keep authors' prints."""
    printing = {
        name
        for name in GRAPH
        for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
    }
    assert {floor(name) for name in printing} == {"terminal"}


def test_nothing_is_long():
    """No file above 400 lines, no class above 200, no function above 40."""
    most = {ast.ClassDef: 200, ast.FunctionDef: 40, ast.AsyncFunctionDef: 40}
    long = []
    for path in (*MODULES.values(), *(ROOT / "blocks").glob("*.py")):
        text = path.read_text(encoding="utf-8")
        sizes = [(path.stem, text.count("\n"), 400)]
        for node in ast.walk(ast.parse(text)):
            if limit := most.get(type(node)):
                sizes.append((f"{path.stem}.{node.name}", node.end_lineno - node.lineno + 1, limit))
        long += [(name, lines) for name, lines, limit in sizes if lines > limit]
    assert long == []


def test_no_two_classes_and_no_two_files_share_a_name():
    """A command's file is called as the command is."""
    files = Counter(name.rpartition(".")[2] for name in GRAPH if ".commands." not in name)
    classes = Counter(
        node.name
        for name in GRAPH
        for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_")
    )
    assert [name for name, count in (files + classes).items() if count > 1] == []


def test_the_tests_stand_where_the_files_do():
    folders = {path.parent.name for path in (ROOT / "tests").rglob("test_*.py")} - {"tests", "blocks"}
    assert folders <= set(FLOORS)


def test_the_readme_tells_of_every_folder():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [name for name in FLOORS if f"`{name}" not in text] == []
