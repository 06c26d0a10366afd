"""`cosim watch` as a person has it: the command in a process, the page in a browser."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
PATIENCE = 60.0  # of a machine that is busy
ROOT = Path(__file__).parents[2]
LAG = """
title: A lag <b>of first order</b>
run: {stop: 4, step: 1.0e-3, method: joint, integrator: rk4}
blocks:
  lag:
    python: lag.py:Lag
    parameters: {T: 0.5}
    inputs: {u: 1}
record: {period: 0.01, signals: [lag.x]}
metrics: {last: {signal: lag.x, reduce: final}, at_T: {signal: lag.x, reduce: final, to: 0.5}}
requirements: {settles: "eventually (lag.x > 0.9)"}
"""
BLOCK = '''"""A block."""

from cosim import Block, Input, Parameter, State


class Lag(Block):
    """T dx/dt = u - x."""

    u = Input()
    x = State(output=True, unit="m", description="what lags")
    T = Parameter(unit="s", min=0.001)

    def derivatives(u, x, T, d_x):
        d_x[0] = (u - x) / T
'''


class Watch:
    """`cosim watch` in a folder: `address` of the page; `stop` ends it as Ctrl-C does."""

    def __init__(self, folder: Path, *words: object) -> None:
        self.folder = folder
        environment = {**os.environ, "PYTHONPATH": str(ROOT)}
        command = [sys.executable, "-m", "cosim", "watch", "--no-browser", *map(str, words)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        self.process = subprocess.Popen(command, cwd=folder, env=environment, text=True, **pipes)
        self.first = self.process.stdout.readline()
        found = re.search(r"http://\S+", self.first)
        self.address = found[0] if found else ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self, number: int = signal.SIGINT) -> tuple[int, str]:
        """The exit code, and what it wrote to standard error."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            _, told = self.process.communicate(timeout=PATIENCE)
        except ValueError:  # stopped before
            told = ""
        return self.process.returncode, told


def until(holds: Callable[[], object], what: str = "what was waited for") -> None:
    """Wait until something holds."""
    limit = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < limit, f"{what} did not come"
        time.sleep(0.01)


@pytest.fixture
def lag(tmp_path) -> Path:
    """A folder with a diagram, `lag.yaml`, and its block, `lag.py`."""
    (tmp_path / "lag.yaml").write_text(LAG)
    (tmp_path / "lag.py").write_text(BLOCK)
    return tmp_path


@pytest.fixture(scope="module")
def browser():
    """A browser, as it is installed here."""
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no browser: apt-get install chromium")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        options = ["--no-sandbox", "--disable-gpu", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"]
        opened = driver.chromium.launch(executable_path=found, args=options)
        yield opened
        opened.close()


@pytest.fixture
def see(browser):
    """Open a page in a window of its own; at the end, no script of it may have failed."""
    failed, windows = [], []

    def open_page(address: str, width: int = 1280, dark: bool = False):
        window = browser.new_context(viewport={"width": width, "height": 900}, color_scheme="dark" if dark else "light")
        windows.append(window)
        page = window.new_page()
        page.set_default_timeout(1e3 * PATIENCE)
        page.on("pageerror", lambda error: failed.append(str(error)))
        page.on("console", lambda said: failed.append(said.text) if said.type == "error" else None)
        page.goto(address)
        page.wait_for_selector("body[data-run]")
        return page

    yield open_page
    for window in windows:
        window.close()
    assert failed == []
