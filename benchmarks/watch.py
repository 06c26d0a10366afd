"""How long a person waits: `cosim watch` of 10 s of the formation, in a real browser.

    python benchmarks/watch.py

A save counts from the moment at which the file is written to the one at which the page has drawn the run's figures and
plots; a slider's step from the browser's event to the same. Needs the tests' packages, and Chromium or Chrome.
"""

from __future__ import annotations

import shutil
import statistics
import sys
import tempfile
import time as clock
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from playwright.sync_api import Page, sync_playwright  # noqa: E402

from tests.watch.conftest import BROWSERS, Watch  # noqa: E402

SAVES, STEPS = 20, 60
SLIDER = "[data-path='blocks.controller.parameters.c'] input[type=range]"
DRAWN = """() => { window.drawn = new Promise(done => {
  const before = document.body.dataset.run;
  new MutationObserver((_, seen) => {
    if (document.body.dataset.run === before) return;
    seen.disconnect();
    done(performance.now());
  }).observe(document.body, { attributes: true });
}) }"""
SLIDE = """async (range, value) => {
  const began = performance.now();
  range.value = value;
  range.dispatchEvent(new Event("input"));
  return (await window.drawn - began) / 1000;
}"""


def show(name: str, seconds: list[float]) -> None:
    """One line: median, 95th percentile, longest."""
    ordered = sorted(seconds)
    late = ordered[int(0.95 * (len(ordered) - 1))]
    print(f"{name:32} {len(ordered):4} {statistics.median(ordered):8.3f} {late:8.3f} {ordered[-1]:8.3f}")


def save(page: Page, path: Path, text: str) -> float:
    """Write the diagram, and wait until the page has drawn its run (s)."""
    page.evaluate(DRAWN)
    began = clock.perf_counter()
    path.write_text(text, encoding="utf-8")
    page.evaluate("window.drawn")
    return clock.perf_counter() - began


def slide(page: Page, value: int) -> float:
    """Move the slider, and wait until the page has drawn the run (s)."""
    page.evaluate(DRAWN)
    taken: float = page.locator(SLIDER).evaluate(SLIDE, value)
    return taken


def main() -> None:
    """Print both tables."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as driver:
        text = (ROOT / "diagrams" / "formation.yaml").read_text(encoding="utf-8").replace("stop: 30", "stop: 10")
        path = Path(folder) / "formation.yaml"
        path.write_text(text, encoding="utf-8")
        with Watch(Path(folder), path.name) as watch:
            opened = driver.chromium.launch(executable_path=browser, args=["--no-sandbox", "--disable-gpu"])
            page = opened.new_page(viewport={"width": 1280, "height": 900})
            page.goto(watch.address)
            page.wait_for_selector("body[data-run]", timeout=120_000)
            saves = [save(page, path, text.replace("c: 2,", f"c: {2 + k / 100},")) for k in range(1, SAVES + 1)]
            steps = [slide(page, 101 + k) for k in range(STEPS)]
            opened.close()
    print(f"{'seconds':32} {'of':>4} {'median':>8} {'95 %':>8} {'most':>8}")
    show("a save, to figures and plots", saves)
    show("a slider's step", steps)


if __name__ == "__main__":
    main()
