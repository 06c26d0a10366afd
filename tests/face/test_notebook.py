"""Classes of a notebook's cells and of a prompt: found with their source, compiled anew when they are defined anew."""

from __future__ import annotations

import linecache
import subprocess
import sys
from pathlib import Path

import pytest

import cosim
from cosim.errors import DeclarationError, UnknownBlock, WrongType

CELL = '''
import cosim

class Amplifier(cosim.Block):
    """y = k u."""

    u = cosim.Input()
    y = cosim.Output()
    k = cosim.Parameter(default=2.0)

    def outputs(u, k, y):
        y[0] = {}
'''
YAML = """
run: {stop: 0.1, step: 0.01}
blocks: {g: {block: Amplifier, start: {u: 3}}}
metrics: {y: {signal: g.y, reduce: final}}
"""


@pytest.fixture
def cell(monkeypatch):
    """Run a notebook's cell: its file is none, its source is kept by `linecache`, its names are those of __main__."""
    scope = vars(sys.modules["__main__"])
    for name in ("Amplifier", "helper"):
        monkeypatch.setitem(scope, name, None)
    numbers = iter(range(1000))

    def run(text: str, name: str = "") -> None:
        file = name or f"<ipython-input-{next(numbers)}-{abs(hash(text))}>"
        if not name:
            linecache.cache[file] = len(text), None, text.splitlines(keepends=True), file
        exec(compile(text, file, "exec"), scope)

    run.scope = scope
    return run


def diagram(block: type) -> cosim.BlockDiagram:
    run = {"stop": 0.1, "step": 0.01}
    metrics = {"y": {"signal": "g.y", "reduce": "final"}}
    return cosim.diagram({"run": run, "blocks": {"g": {"block": block, "start": {"u": 3}}}, "metrics": metrics})


def test_a_class_that_is_defined_anew_is_another(cell):
    cell(CELL.format("k * u"))
    first = diagram(cell.scope["Amplifier"])
    assert first.run().metrics == {"y": 6.0}
    cell(CELL.format("k * u + 1"))
    second = diagram(cell.scope["Amplifier"])
    assert [d.run(engine).metrics["y"] for d in (second, first) for engine in ("native", "python")] == [7, 7, 6, 6]
    assert first.swap(g=cell.scope["Amplifier"]).run().metrics == {"y": 7.0}
    assert first.sweep([{"blocks.g.k": k} for k in (1, 2)])["y"].tolist() == [3.0, 6.0]


def test_what_a_class_calls_may_be_defined_anew_too(cell):
    cell("def helper(x):\n    return 10.0 * x\n")
    cell(CELL.format("helper(u) * k"))
    made = diagram(cell.scope["Amplifier"])
    assert made.run().metrics == {"y": 60.0}
    cell("def helper(x):\n    return 20.0 * x\n")
    assert made.run().metrics == made.run("python").metrics == {"y": 120.0}


def test_a_yaml_file_names_a_class_that_is_handed_over(cell, folder):
    cell(CELL.format("k * u"))
    (folder / "g.yaml").write_text(YAML, encoding="utf-8")
    (folder / "outer.yaml").write_text(
        "run: {stop: 0.1, step: 0.01}\nblocks: {in: {diagram: g.yaml}}\nmetrics: {y: {signal: in/g.y, reduce: final}}",
        encoding="utf-8",
    )
    gain = cell.scope["Amplifier"]
    for file in ("g.yaml", "outer.yaml"):
        assert cosim.load(file, blocks=[gain]).run().metrics == {"y": 6.0}
        with pytest.raises(UnknownBlock, match=r"hand the class over: cosim\.load\(…, blocks=\[Amplifier\]\)"):
            try:
                cosim.load(file).run()
            except cosim.errors.DiagramErrors as found:
                raise found.errors[0] from None
    with pytest.raises(WrongType, match="`blocks` takes classes"):
        cosim.load("g.yaml", blocks=[int])


def test_mistakes_are_told_at_the_line_of_the_cell(cell):
    cell(CELL.format("k * undefined * u"))
    with pytest.raises(cosim.CosimError, match=r"<ipython-input-.*>:12:20: Amplifier.outputs\(\) uses `undefined`"):
        diagram(cell.scope["Amplifier"]).check()
    with pytest.raises(cosim.CosimError, match="returns a value"):
        cell(CELL.format("k * u; return 1"))
    with pytest.raises(cosim.CosimError, match="the class int is no type of block"):
        diagram(int).check()


def test_a_class_without_source_is_refused(cell):
    cell(CELL.format("k * u"), name="<stdin>")
    with pytest.raises(cosim.CosimError, match=r"the source of Amplifier\.outputs\(\) cannot be found") as raised:
        diagram(cell.scope["Amplifier"]).run()
    assert isinstance(raised.value.errors[0], DeclarationError)


def test_import_is_light():
    code = "import sys, cosim; print(sorted({'numpy', 'yaml', 'pathlib', 'cosim.errors'} & set(sys.modules)))"
    path = {"PYTHONPATH": str(Path(cosim.__file__).parents[1])}
    done = subprocess.run([sys.executable, "-S", "-c", code], capture_output=True, text=True, check=True, env=path)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(("kind", "made"), [("block", int), ("python", cosim.Block), ("fmu", cosim.Block)])
def test_what_is_no_type_of_block_is_told(kind, made):
    wrong = cosim.diagram({"run": {"stop": 1, "step": 1}, "blocks": {"g": {kind: made}}})
    with pytest.raises(cosim.CosimError, match=f"the class {made.__qualname__} is no type of block behind `{kind}:`"):
        wrong.run()
