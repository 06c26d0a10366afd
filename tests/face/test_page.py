"""Every block of code of the page on Python runs, from top to bottom, in a folder of its own."""

from __future__ import annotations

import linecache
import re
from pathlib import Path

import matplotlib as mpl
import pytest

PAGE = Path(__file__).parents[2] / "docs" / "python.md"
BLOCKS = re.findall(
    r"^```(\w+)(?: file=(\S+))?\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
)
#: What the page says of a block that has these words, to be true once it has run.
CLAIMS = {
    "# about 10": 'run.metrics["final_speed"] == pytest.approx(10, abs=1e-3)',
    '# "completed"': 'run.status == "completed" and run.ended == ""',
    "motor.nc": 'run.signals["motor.speed"].dims == ("time",)',
    "an element for each run": 'table["largest_current"].shape == (4,) and len(table.rows) == 4',
    "# (2, 3, 4)": 'table["largest_current"].shape == (2, 3, 4) and len(table.dimensions) == 3',
    '# "diverged"': 'unstable.run(check=False).status == "diverged"',
    "motor.load": 'sim["motor.speed"] == pytest.approx(10, abs=0.05)',
}


def test_the_page(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")
    scope = {"__name__": "__main__", "pytest": pytest}
    for number, (_, file, text) in enumerate(BLOCKS):
        if file:
            (tmp_path / file).write_text(text, encoding="utf-8")
            continue
        name = f"<python.md, block {number}>"
        linecache.cache[name] = len(text), None, text.splitlines(keepends=True), name
        exec(compile(text, name, "exec"), scope)
        for words, claim in CLAIMS.items():
            assert words not in text or eval(claim, scope), claim  # noqa: S307  # of this file


def test_all_blocks_are_found():
    text = PAGE.read_text(encoding="utf-8")
    assert len(BLOCKS) == text.count("\n```") // 2 > 10
    assert {language for language, file, _ in BLOCKS if not file} == {"python"}
    assert all(words in text for words in CLAIMS)
