"""The loop is compiled by a process of its own beside the blocks; whatever becomes of it, there is a loop."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from cosim.engine import loop_code
from cosim.machine import cache, parallel

ROOT = Path(__file__).parents[2]
KEEPS = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
from cosim.engine import loop_code
from tests.engine import test_loop_code
loop_code._FUNCTIONS = (test_loop_code.short,)
loop_code.compile_loop()
"""


def short(time: float, base: int, frame: int) -> int:
    """A loop that is soon compiled."""
    return 7


@pytest.fixture(autouse=True)
def an_empty_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(loop_code, "_FUNCTIONS", (short,))
    monkeypatch.setattr(parallel, "processors", lambda: 2)


@pytest.fixture
def began(monkeypatch):
    """The other processes that have been begun."""
    processes, begin = [], subprocess.Popen

    def noted(*words, **options):
        processes.append(begin(*words, **options))
        return processes[-1]

    monkeypatch.setattr(subprocess, "Popen", noted)
    return processes


@pytest.mark.parametrize("words", [KEEPS, "raise SystemExit(1)"])
def test_the_loop_comes_from_the_other_process_or_is_compiled_here(monkeypatch, began, words):
    monkeypatch.setattr(loop_code, "_WORDS", words)
    compiled_here = []
    monkeypatch.setattr(cache, "write", lambda *entry: compiled_here.append(entry))
    with loop_code.compiled_beside(plain=False) as loop:
        module = loop()
    assert len(began) == 1
    assert len(compiled_here) == (words != KEEPS)
    assert module.compiled_now
    assert module.load().address("short")


def test_what_is_kept_needs_no_other_process(began):
    module = loop_code.compile_loop()
    assert module.compiled_now
    with loop_code.compiled_beside(plain=False) as loop:
        assert not loop().compiled_now
    assert not began


@pytest.mark.parametrize("why", ["one processor", "no cache"])
def test_what_cannot_be_handed_over_is_compiled_here(monkeypatch, began, tmp_path, why):
    if why == "no cache":
        (tmp_path / "cache").write_text("no folder")
    else:
        monkeypatch.setattr(parallel, "processors", lambda: 1)
    with loop_code.compiled_beside(plain=False) as loop:
        assert loop().compiled_now
    assert not began


def test_the_other_process_ends_when_a_block_cannot_be_compiled(monkeypatch, began):
    monkeypatch.setattr(loop_code, "_WORDS", "import time; time.sleep(3600)")
    with pytest.raises(ZeroDivisionError), loop_code.compiled_beside(plain=False):
        raise ZeroDivisionError
    assert began[0].returncode not in (0, None)
