"""All that the page shows at a moment, put together."""

from __future__ import annotations

import hashlib

from cosim.watch import curve_views, figure_views, mistake_views
from cosim.watch.orders import Died, Figures, Sketch, View


def state(sketch: Sketch | None, now: Figures | None, before: Figures | None) -> View:
    """What is known of a diagram, of its run and, beside it, of the one before."""
    view: View = {"sketch": None, "run": None}
    if sketch:
        marks = {"drawing": _mark(sketch.drawing), "sketched": sketch.number}
        view["sketch"] = {**sketch.view, **marks}
    if now:
        view["run"] = {
            **now.view,
            "number": now.number,
            "before": before.number if before else None,
            "metrics": figure_views.metrics(now, before),
            "requirements": figure_views.requirements(now, before),
            "signals": [curve_views.layout(recorded) for recorded in now.track.signals.values()],
            "first": list(dict.fromkeys(now.reduced)),
        }
    return view


def _mark(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def block(sketch: Sketch | None, now: Figures | None, name: str) -> View | None:
    """A block, or all blocks of a diagram that is one, with the values of its signals at the end of a run."""
    found = [
        view for known, view in (sketch.blocks if sketch else {}).items() if name in (known, known.partition("/")[0])
    ]
    if not found:
        return None
    values = now.values if now else {}
    recorded = now.track.signals if now else {}
    parts = [
        view
        | {
            "signals": [
                port | {"value": values.get(port["signal"], ""), "recorded": port["signal"] in recorded}
                for port in view["signals"]
            ]
        }
        for view in found
    ]
    return {"name": name, "parts": parts, "time": now.view["time"] if now else None}


def death(answer: Died) -> View:
    """That the process in which the diagram ran is gone, as a mistake."""
    message = f"the process that ran the diagram has ended: {answer.how}"
    return mistake_views.told(message, "what a block printed is where `cosim watch` runs; save again to run anew")
