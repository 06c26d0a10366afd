"""A diagram's drawing: nothing of it is cut, and wires lead back to what the file names first."""

from __future__ import annotations

import re

import cosim

NUMBER = r"-?\d+(?:\.\d+)?"
LOOP = {
    "blocks": {
        "controller": {"block": "PID", "inputs": {"r": 1, "y": "plant.x"}},
        "plant": {"block": "FirstOrder", "inputs": {"u": "controller.u"}},
        "itself": {"block": "FirstOrder", "inputs": {"u": "itself.x"}},
    },
    "run": {"stop": 1, "step": 0.1},
}


def reached(svg: str) -> tuple[list[float], list[float]]:
    """All x and y that boxes and wires reach, as the picture's pixels."""
    edge = float(re.search(rf"translate\(({NUMBER})", svg)[1])
    xs, ys = [], []
    for x, y, width, height in re.findall(r'<rect x="(\d+)" y="(\d+)" width="(\d+)" height="(\d+)"', svg):
        xs += [float(x), float(x) + float(width)]
        ys += [float(y), float(y) + float(height)]
    for path in re.findall(r'<path(?: class="b")? d="([^"]*)" marker', svg):
        for command, numbers in re.findall(r"([MCHV])([^MCHV]*)", path):
            values = [float(v) for v in re.findall(NUMBER, numbers)]
            xs += values if command == "H" else values[::2] if command in "MC" else []
            ys += values if command == "V" else values[1::2] if command in "MC" else []
    return [x + edge for x in xs], [y + edge for y in ys]


def test_every_box_and_wire_lies_within_the_picture():
    svg = cosim.diagram(LOOP).draw().svg
    width, height = (float(v) for v in re.search(rf'viewBox="0 0 ({NUMBER}) ({NUMBER})"', svg).groups())
    xs, ys = reached(svg)
    assert min(xs) > 0 and max(xs) < width
    assert min(ys) > 0 and max(ys) < height


def test_the_wire_that_leads_back_is_the_one_to_what_the_file_names_first():
    svg = cosim.diagram(LOOP).draw().svg
    back = re.findall(r'<path class="b"[^>]*><title>([^<]*)</title>', svg)
    assert back == ["plant.x → controller.y", "itself.x → itself.u"]
