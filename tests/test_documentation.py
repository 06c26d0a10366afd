"""The documentation: all code in it runs, for a reader who has only the package installed, and no link is broken."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cosim.wiring import library

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
WRITTEN = ("reference/keys.md", "reference/blocks.md", "reference/commands.md")
OF_PYTHON = DOCS / "python.md"  # whose code `tests/face/test_page.py` runs
PAGES = sorted(p for p in DOCS.rglob("*.md") if str(p.relative_to(DOCS)) not in WRITTEN and p != OF_PYTHON)
FENCE = re.compile(r"^(`{3,})([\w{}-]*)(?: file=(\S+))?\n(.*?)^\1$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"# exit code (\d+).*$")


def blocks(page: Path) -> list[tuple[str, str, str]]:
    """Language, file and text of what stands in fences."""
    return [(language, file, text) for _, language, file, text in FENCE.findall(page.read_text(encoding="utf-8"))]


@pytest.fixture(scope="session")
def environment(user) -> dict[str, str]:
    """That of a shell of somebody who has no clone, with a terminal of 100 columns."""
    others = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    return {**others, "PATH": f"{user / 'bin'}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "100"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_every_block_of_a_page_runs_from_top_to_bottom_in_an_empty_folder(page, tmp_path, environment):
    shown = ""
    for language, file, text in blocks(page):
        if file:
            (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file).write_text(text, encoding="utf-8")
        elif language == "sh":
            shown = "".join(run(line, tmp_path, environment) for line in re.sub(r"\\\n", " ", text).splitlines())
        elif language == "text":
            assert printed(text, shown), f"it says\n{text}\nand what is printed is\n{shown}"
        else:
            assert language in ("{toctree}", "{eval-rst}"), language


def run(line: str, folder: Path, environment: dict[str, str]) -> str:
    """What a line of the shell prints, which ends as it says."""
    wanted = CODE.search(line)
    done = subprocess.run(
        ["sh", "-c", line], cwd=folder, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == int(wanted[1] if wanted else 0), f"{line}\n{done.stdout}{done.stderr}"
    assert "Traceback" not in done.stderr, done.stderr
    return done.stdout


def printed(text: str, shown: str) -> bool:
    """Whether a text, in which an ellipsis stands for anything, is what was printed; white space aside."""
    lines = [" ".join(line.split()) for line in text.splitlines()]
    pattern = r"\n".join(r"(.|\n)*" if line == "…" else re.escape(line).replace("…", ".*") for line in lines)
    return (
        re.fullmatch(rf"\s*{pattern}\s*", "\n".join(" ".join(line.split()) for line in shown.splitlines())) is not None
    )


def test_what_a_page_says_is_printed_is_looked_at():
    assert printed("a  b\n…\nc … e\n", "a b\nx\ny\nc   d e\n")
    assert not printed("a\nb\n", "a\nc\n")
    assert not printed("a\n", "a\nb\n")


def test_no_page_has_code_that_nothing_runs():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert len(blocks(page)) == len(re.findall(r"^`{3,}", text, re.MULTILINE)) / 2, page
        assert not [b for b in blocks(page) if b[0] == "yaml" and not b[1]], f"{page}: which file is it?"


def test_the_documentation_is_built_without_a_warning(tmp_path):
    """So all links between pages and to files lead somewhere, and all pages are in the table of contents."""
    shutil.copytree(DOCS, tmp_path / "docs", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "diagrams", tmp_path / "diagrams", ignore=shutil.ignore_patterns("results"))
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", tmp_path / "docs", tmp_path / "built"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    commands, page = (
        (tmp_path / "built" / "reference" / f"{n}.html").read_text("utf-8") for n in ("commands", "blocks")
    )
    assert "results/&lt;diagram&gt;.nc" in commands
    motor = (tmp_path / "built" / "tutorials" / "motor.html").read_text("utf-8")
    captions = re.findall(r'class="code-block-caption"><span class="caption-text">([^<]*)<', motor)
    assert captions == ["motor.yaml", "sampled.yaml"]
    drawings = dict(re.findall(r'<svg class="block" role="img" aria-label="(\w+)"(.*?)</svg>', page, re.DOTALL))
    ports = {name: re.findall(r'text-anchor="(start|end)">(\w+)<', drawing) for name, drawing in drawings.items()}
    assert ports.keys() == library.all_blocks().keys()
    assert ports["PID"] == [("start", "r"), ("start", "y"), ("start", "feed_forward"), ("end", "v"), ("end", "u")]
