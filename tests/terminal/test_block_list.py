"""`cosim blocks`: groups, words to look for, where each comes from, and own files, of which nothing runs."""

import sys
from pathlib import Path

import pytest

from cosim.engine import run
from cosim.errors import AmbiguousBlock, DiagramErrors, UnknownBlock
from cosim.machine import distributions
from cosim.terminal import cli
from cosim.wiring import catalogue, library

SERVO = '''"""Motors and what drives them."""
from cosim import Block, Input, Output

print("run")


class Servo(Block):
    """A servo that follows its input, y = {k} u.

    More words, such as resolver.
    """

    u = Input()
    y = Output()

    def outputs(u, y):
        y[0] = {k} * u
'''
OWN = '''"""Mine."""
import cosim
from cosim import Block as Base, Output

raise RuntimeError("this file was run")


class Mine(Base):
    """y = 1."""


class Deeper(Mine):
    """A child of Mine."""


class Other(cosim.Measure):
    """Without an import of its base."""


class _Hidden(Base):
    pass


class NoBlock:
    pass


class NoBlockEither(NoBlock):
    pass
'''


@pytest.fixture
def packs(tmp_path, monkeypatch):
    """Two packs that have one name each, beside the library; and a folder of one's own."""
    site, own = tmp_path / "site", tmp_path / "own"
    for name, k in (("acme_motors", 2), ("others", 3)):
        (site / name).mkdir(parents=True)
        (site / name / "__init__.py").write_text(f'"""The pack {name}."""\n')
        (site / name / "servo.py").write_text(SERVO.format(k=k))
    (site / "acme_motors" / "more.py").write_text(SERVO.format(k=4).replace("Servo", "Stepper"))
    own.mkdir()
    monkeypatch.chdir(own)
    monkeypatch.syspath_prepend(str(site))
    pairs = {"cosim": "cosim.blocks", "acme.motors": "acme_motors", "others": "others"}
    points = [distributions.EntryPoint(name, value) for name, value in pairs.items()]
    monkeypatch.setattr(distributions, "entry_points", lambda group: points)
    library._points.cache_clear()
    library._libraries.cache_clear()
    yield own
    library._points.cache_clear()
    library._libraries.cache_clear()
    for name in [name for name in sys.modules if name.partition(".")[0] in ("acme_motors", "others")]:
        del sys.modules[name]


def shown(capsys, *words):
    capsys.readouterr()
    assert cli.main(["blocks", *words]) == 0
    return capsys.readouterr().out


def refused(capsys, *words):
    capsys.readouterr()
    assert cli.main(["blocks", *words]) == 2
    return capsys.readouterr().err


def test_groups_are_files_of_the_library_and_packs_and_own_files(packs, capsys):
    Path("mine.py").write_text(OWN)
    out = shown(capsys)
    assert (
        "\nacme.motors: The pack acme_motors.\n" in out
        and out.startswith("arithmetic: ")
        and "\nreference: Where each robot" in out
    )
    assert "\n  acme.motors:Servo  A servo" in out and "\n  Stepper " in out  # a name that one pack alone has
    assert "\nmine.py: Mine.\n  Mine    y = 1.\n  Deeper  A child of Mine.\n  Other   Without" in out
    assert "_Hidden" not in out and "NoBlock" not in out
    count = sum(len(group.blocks) for group in [*catalogue.installed(), *catalogue.own(Path())])
    assert f"\n{count} blocks. `cosim blocks NAME`" in out


def test_words_find_names_and_texts(packs, capsys):
    out = shown(capsys, "RESOLVER", "words")
    assert "acme.motors:Servo" in out and "others:Servo" in out and "NeuralObserver" not in out
    assert "PotentialField" in shown(capsys, "field")
    assert "did you mean `Stepper`?" in refused(capsys, "Steper")
    assert "lists all there are" in refused(capsys, "qqqq")


@pytest.mark.parametrize(("name", "k"), [("acme.motors:Servo", 2), ("acme_motors.servo:Servo", 2), ("others:Servo", 3)])
def test_a_qualified_name_says_which(packs, trajectories, capsys, name, k):
    Path("d.yaml").write_text(f"run: {{stop: 1, step: 1}}\nblocks: {{s: {{block: {name}, inputs: {{u: 5}}}}}}\n")
    assert trajectories(run.load("d.yaml"), "s.y")["s.y"][-1] == 5 * k
    again = run.load("d.yaml", swaps=["s=Stepper"])
    assert trajectories(again, "s.y")["s.y"][-1] == 20
    page = shown(capsys, name)
    assert f"y = {k} u" in page and "servo.py" in page and f"block: {name}" in page
    Path("r.yaml").write_text(run.load("d.yaml").diagram.resolved())
    assert trajectories(run.load("r.yaml"), "s.y")["s.y"][-1] == 5 * k


@pytest.mark.parametrize(
    ("name", "kind", "said", "fix"),
    [
        ("Servo", AmbiguousBlock, "both in acme_motors.servo and others.servo", "acme.motors:Servo or others:Servo"),
        ("acme.motors:Srvo", UnknownBlock, "no block type `acme.motors:Srvo`", "did you mean `acme.motors:Servo`?"),
        ("acme.motor:Stepper", UnknownBlock, "no block type", "write acme.motors:Stepper"),
        ("acme.motor:X", UnknownBlock, "no block type", "did you mean `acme.motors`?"),
        ("mine.py:Mine", UnknownBlock, "no block type", "write `python: mine.py:Mine`"),
    ],
)
def test_names_that_say_nothing_or_too_much(packs, name, kind, said, fix):
    Path("d.yaml").write_text(f"run: {{stop: 1, step: 1}}\nblocks: {{s: {{block: {name}, inputs: {{u: 5}}}}}}\n")
    with pytest.raises(DiagramErrors) as caught:
        run.load("d.yaml")
    (error,) = caught.value.errors
    assert type(error) is kind and said in error.message and fix in error.fix


def test_a_file_a_folder_and_a_diagram_have_blocks(packs, capsys):
    Path("deep/er").mkdir(parents=True)
    Path("deep/er/mine.py").write_text(OWN)
    Path("deep/broken.py").write_text("from cosim import Block\nclass (")
    Path("deep/d.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {a: {python: 'er/mine.py:Mine'}}\n")
    for what in ("deep/er/mine.py", "deep", "deep/d.yaml", "."):
        assert "deep/er/mine.py: Mine.\n  Mine " in shown(capsys, what)
    assert "no file `deep/er/mime.py`" in refused(capsys, "deep/er/mime.py")
    Path("none.yaml").write_text("run: {stop: 1, step: 1}\nblocks: {a: {block: Stepper, inputs: {u: 1}}}\n")
    assert "no file of blocks is named" in refused(capsys, "none.yaml")
    Path("a.txt").write_text("")
    assert "holds no blocks" in refused(capsys, "a.txt")


def test_an_own_block_shows_its_page_by_name_or_file(packs, capsys):
    Path("own.py").write_text(SERVO.format(k=7).replace("Servo", "Winch"))
    page = shown(capsys, "winch")
    assert "y = 7 u" in page and "a diagram writes  python: own.py:Winch" in page
    assert shown(capsys, "own.py:Winch").partition("Winch")[2] == page.partition("Winch")[2]


def test_environments_and_hidden_folders_are_not_searched(packs):
    for folder in (".hidden", "env/lib", "node_modules", "a/b/c/d"):
        Path(folder).mkdir(parents=True)
        Path(folder, "mine.py").write_text(OWN)
    Path("env/pyvenv.cfg").write_text("")
    assert catalogue.own(Path()) == []
    Path("a/b/mine.py").write_text(OWN)
    assert [group.title for group in catalogue.own(Path())] == ["a/b/mine.py"]


def test_a_page_breaks_words_where_the_terminal_ends_and_no_equation(packs, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    lines = shown(capsys, "TransferFunction").splitlines()
    words = [line for line in lines if line and not line.startswith((" ", "in "))]
    assert "x_{k+1}/dt = x_k. A vector is filtered element by element." in " ".join(words)
    assert max(map(len, words)) <= 60 and "    ──── = ─────────────────,   m < n" in lines


@pytest.mark.parametrize("columns", [80, 120])
def test_no_line_is_longer_than_the_terminal(packs, capsys, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    assert max(map(len, shown(capsys).splitlines())) <= columns
