"""How long an editor waits: `cosim lsp` driven by a real client, which types into the formation's diagram key by key.

    python benchmarks/editor.py

At each key the text is sent, and completion asked for, as editors do; times are from the key to the answer, with all
that the protocol takes. Mistakes are told once nothing is typed for a moment, which is part of their time.
"""

from __future__ import annotations

import asyncio
import statistics
import sys
import time as clock
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from cosim.editor.server import PAUSE  # noqa: E402
from tests.editor.client import Editor  # noqa: E402
from tests.editor.test_diagnostics import THIRTY  # noqa: E402

TYPED = """\
  smooth:
    block: LowPass
    parameters: {bandwidth: 20}
    inputs: {u: separation.min_gap}
"""


def show(name: str, seconds: list[float]) -> None:
    """One line: median, 95th percentile, longest."""
    ordered = sorted(seconds)
    most, late = ordered[-1], ordered[int(0.95 * (len(ordered) - 1))]
    median = statistics.median(ordered)
    print(f"{name:44} {len(ordered):5} {1e3 * median:8.1f} {1e3 * late:8.1f} {1e3 * most:8.1f}")


async def timed(seconds: list[float], asked):
    """What is answered; how long that took is added."""
    began = clock.perf_counter()
    answer = await asked
    seconds.append(clock.perf_counter() - began)
    return answer


async def typing(editor: Editor, name: str, text: str) -> dict[str, list[float]]:
    """Type a block before the recording, key by key."""
    begin = text.index("\nrecord:") + 1
    line = text[:begin].count("\n")
    times: dict[str, list[float]] = {"a key: completion": [], "a key, then rest: mistakes": []}
    for typed in range(1, len(TYPED) + 1):
        part = TYPED[:typed]
        now = text[:begin] + part + "\n" + text[begin:]
        row, column = line + part.count("\n") + 1, len(part) - part.rfind("\n")
        began = clock.perf_counter()
        editor.type(name, now)
        await editor.offered(name, row, column)
        times["a key: completion"].append(clock.perf_counter() - began)
        if typed % 5 == 0:
            await timed(times["a key, then rest: mistakes"], editor.change(name, now))
    return times


async def session(path: Path, text: str) -> None:
    """Time everything of one diagram."""
    async with Editor(path.parent) as editor:
        first: list[float] = []
        await timed(first, editor.open(path.name))
        times = await typing(editor, path.name, text)
        await editor.change(path.name, text)
        lines = text.split("\n")
        wires = [n for n, row in enumerate(lines, 1) if ": plant.x" in row]
        for name, ask in (("hover", editor.hover), ("definition", editor.definition)):
            times[name] = []
            for row in wires * 3:
                await timed(times[name], ask(path.name, row, lines[row - 1].index("plant.x") + 3))
        times["rename"] = []
        for _ in range(5):
            row = wires[0]
            await timed(times["rename"], editor.rename(path.name, row, lines[row - 1].index("plant.x") + 3, "robot_x"))
        times["thirty mistakes in another file"] = []
        await editor.open("thirty.yaml", THIRTY)
        for k in range(10):
            await timed(times["thirty mistakes in another file"], editor.change("thirty.yaml", THIRTY + f"# {k}\n"))
    print(f"{path.name}: milliseconds{'':25} count   median      95 %  longest")
    show("open: mistakes, the first time", first)
    for name, seconds in times.items():
        show(name, seconds)
    print(f"mistakes wait for {1e3 * PAUSE:.0f} ms without a key")


def main() -> None:
    """Print the table."""
    path = ROOT / "diagrams" / "formation.yaml"
    asyncio.run(session(path, path.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()
