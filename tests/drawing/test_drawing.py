"""A drawing shows every block, port and wire once, within the picture, and none over another."""

from __future__ import annotations

from itertools import combinations, pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest

import cosim
from cosim.drawing import boxes, layers, placement, printed, shapes, svg
from cosim.drawing.mermaid import mermaid
from cosim.engine import run
from cosim.errors import PlotError
from cosim.terminal import cli

DIAGRAMS = Path(__file__).parents[2] / "diagrams"
SHIPPED = sorted(p for p in DIAGRAMS.rglob("*.yaml") if not {"studies", "fmus"} & {*p.parts})
NO_DRAWING = [("d.jpg", "drawings are"), ("notes.svg", "is not replaced"), ("no/", "drawings are")]
LOOP = """
run: {stop: 1, step: 0.1}
blocks:
  controller: {block: PID, inputs: {r: 1, y: plant.x}}
  plant: {block: FirstOrder, inputs: {u: controller.u}}
  itself: {block: FirstOrder, inputs: {u: itself.x}}
"""


@pytest.fixture
def network(tmp_path, monkeypatch):
    """Wire a text."""
    monkeypatch.chdir(tmp_path)

    def made(text: str, *settings: str):
        Path("diagram.yaml").write_text(text)
        return run.load("diagram.yaml", settings)

    return made


def placed(network):
    found, wires = boxes.boxes(network)
    arranged = layers.layers(list(found), wires)
    return found, wires, arranged, placement.places(found, arranged)


def corners(found, where):
    """Of each box: left, top, right, bottom."""
    edges = {}
    for name, box in found.items():
        k, top = where.column[name], where.top[name]
        edges[name] = (where.left[k], top, where.left[k] + where.width[k], top + placement.box_height(box))
    return edges


@pytest.mark.parametrize("file", SHIPPED, ids=lambda p: p.stem)
def test_no_box_lies_on_another_or_on_a_wire_that_passes(file):
    found, wires, arranged, where = placed(run.load(file))
    where_boxes = corners(found, where)
    for a, b in combinations(where_boxes.values(), 2):
        assert a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
    for slot, top in where.top.items():
        if not isinstance(slot, str):
            for name in (s for s in arranged.columns[where.column[slot]] if isinstance(s, str)):
                _, upper, _, lower = where_boxes[name]
                assert top + placement.PASSING <= upper or lower <= top
    assert len({(w.source, w.target) for w in wires}) == len(wires)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda p: p.stem)
def test_every_port_that_is_wired_is_joined_and_all_is_within_the_picture(file):
    made = shapes.drawing(run.load(file))
    points = []
    for shape in made.shapes:
        if isinstance(shape, shapes.Line):
            points += shape.points
        elif isinstance(shape, shapes.Rectangle):
            points += [(shape.x, shape.y), (shape.x + shape.width, shape.y + shape.height)]
    assert all(0 < x < made.width and 0 < y < made.height for x, y in points)
    found, wires = boxes.boxes(run.load(file))
    arrows = {shape.points[-1] for shape in made.shapes if isinstance(shape, shapes.Line) and shape.arrow}
    assert len(arrows) == len({w.target for w in wires}) == sum(len(box.inputs) for box in found.values())
    ElementTree.fromstring(svg.svg(made))  # noqa: S314  # of ours


@pytest.mark.parametrize("file", SHIPPED, ids=lambda p: p.stem)
def test_words_in_a_row_of_a_box_lie_beside_each_other(file):
    """By the width that a letter has in the mean."""
    made = shapes.drawing(run.load(file))
    rows: dict[tuple[float, float], list[tuple[float, float]]] = {}
    for shape in made.shapes:
        if isinstance(shape, shapes.Rectangle) and shape.fill != "none":
            frame = shape  # in front of what was drawn before it
        elif isinstance(shape, shapes.Word):
            wide = len(shape.text) * placement.SMALL * shape.size / 9
            begin = shape.x - {"start": 0.0, "middle": wide / 2, "end": wide}[shape.anchor]
            assert frame.x < begin and begin + wide < frame.x + frame.width, shape
            rows.setdefault((frame.x, shape.y), []).append((begin, begin + wide))
    for row in rows.values():
        assert all(a[1] < b[0] for a, b in pairwise(sorted(row)))


def test_a_box_is_as_wide_as_its_longest_ports():
    name, note = "b" * 20, "3×3 m/s^2"
    box = boxes.Box("x", "block", "y", inputs=[boxes.BoxPort("a" * 20)], outputs=[boxes.BoxPort(name, note)])
    assert placement.box_width(box) > (20 + 20 + 1) * placement.SMALL + len(note) * placement.SMALL * 7.5 / 9 + 2 * 6


def test_a_wire_leads_back_to_what_the_file_names_first(network):
    _, _, arranged, _ = placed(network(LOOP))
    assert [wire.tip for wire in arranged.back] == ["plant.x → controller.y", "itself.x → itself.u"]
    assert [[*column] for column in arranged.columns] == [["controller", "itself"], ["plant"]]


def test_what_can_be_drawn_without_a_crossing_is(network):
    """Two chains that the file names crosswise, with a wire that passes a column."""
    text = """
run: {stop: 1, step: 0.1}
blocks:
  a: {block: Sine}
  b: {block: Sine}
  d: {block: Gain, inputs: {u: b.y}}
  c: {block: Gain, inputs: {u: a.y}}
  e: {block: Sum, parameters: {signs: [1, 1]}, inputs: {u_1: d.y, u_2: b.y}}
  f: {block: Gain, inputs: {u: c.y}}
"""
    _, _, arranged, where = placed(network(text))
    assert placement._crossings(arranged, where.top) == 0


def test_a_straight_chain_is_drawn_straight(network):
    text = "run: {stop: 1, step: 0.1}\nblocks:\n  b0: {block: Sine}\n"
    text += "".join(f"  b{k}: {{block: Gain, inputs: {{u: b{k - 1}.y}}}}\n" for k in range(1, 30))
    _, _, arranged, where = placed(network(text))
    levels = {round(where.inlet(s.right, s.arrive)[1] - where.outlet(s.left, s.leave)[1], 6) for s in arranged.segments}
    assert levels == {0.0} and len(arranged.segments) == 29


def test_marks_say_what_a_block_is(network):
    text = """
run: {stop: 1, step: 0.1}
fleets: {robot: 3}
blocks:
  source: {block: Sine, per: robot}
  slow: {block: UnitDelay, per: robot, period: 0.2, inputs: {u: source.y}}
  late: {block: FirstOrder, per: robot, inputs: {u: {from: slow.y, delay: 0.3}}}
  ring: {block: Gain, parameters: {k: 0.5}, inputs: {u: back.y}}
  back: {block: Bias, inputs: {u: ring.y}}
"""
    found, wires = boxes.boxes(network(text), ["slow"])
    assert found["source"].fleet and found["source"].said == "3 × Sine"
    assert found["slow"].said == "3 × UnitDelay, every 200 ms"
    assert [name for name, box in found.items() if box.looped] == ["ring", "back"]
    assert [name for name, box in found.items() if box.changed] == ["slow"]
    assert [wire.tip for wire in wires if wire.late] == ["slow.y → late.u, 300 ms late"]
    dashed = [s for s in shapes.drawing(network(text)).shapes if isinstance(s, shapes.Line) and s.dashed]
    assert len(dashed) == 1


def test_a_diagram_inside_is_one_box(network, tmp_path):
    (tmp_path / "inner.yaml").write_text("""
run: {stop: 1, step: 0.1}
blocks:
  lag: {block: FirstOrder}
  twice: {block: Gain, inputs: {u: lag.x}}
inputs: {u: [lag.u]}
outputs: {y: twice.y}
""")
    text = """
run: {stop: 1, step: 0.1}
blocks:
  s: {block: Sine}
  in: {diagram: inner.yaml, inputs: {u: s.y}}
  g: {block: Gain, inputs: {u: in.y}}
"""
    found, wires = boxes.boxes(network(text))
    assert list(found) == ["s", "in", "g"]
    assert [wire.tip for wire in wires] == ["s.y → in/lag.u", "in/twice.y → g.u"]


# ---- as files ----


def test_the_command_writes_all_kinds_and_marks_what_an_overlay_changes(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    overlay = DIAGRAMS / "observers" / "high_gain.yaml"
    for kind, begin in (("svg", b"<?xml"), ("png", b"\x89PNG"), ("pdf", b"%PDF"), ("mmd", b"%% drawn")):
        assert cli.main(["draw", str(overlay), "-o", f"d.{kind}"]) == 0
        assert Path(f"d.{kind}").read_bytes().startswith(begin)
        assert "marked: observer" in capsys.readouterr().out
    assert shapes.CHANGED in Path("d.svg").read_text()
    assert cli.main(["draw", str(DIAGRAMS / "motor.yaml")]) == 0
    assert shapes.CHANGED not in Path("motor.svg").read_text()
    assert cli.main(["draw", str(DIAGRAMS / "motor.yaml"), "--set", "blocks.reference.parameters.at=0.7"]) == 0
    assert "marked: reference" in capsys.readouterr().out


def test_a_base_need_not_run_by_itself(tmp_path, monkeypatch, capsys):
    """What an overlay extends may lack what the overlay brings."""
    monkeypatch.chdir(tmp_path)
    Path("base.yaml").write_text("run: {stop: 1, step: 0.1}\nblocks: {g: {block: Gain}}\n")
    Path("over.yaml").write_text("extends: base.yaml\nblocks: {s: {block: Sine}, g: {inputs: {u: s.y}}}\n")
    assert cli.main(["draw", "over.yaml"]) == 0
    assert "marked: g, s" in capsys.readouterr().out


@pytest.mark.parametrize(("output", "said"), NO_DRAWING)
def test_no_other_file_is_written(tmp_path, monkeypatch, capsys, output, said):
    monkeypatch.chdir(tmp_path)
    Path("notes.svg").write_text("<svg>mine</svg>")
    assert cli.main(["draw", str(DIAGRAMS / "motor.yaml"), "-o", output]) == 2
    assert said in capsys.readouterr().err
    assert Path("notes.svg").read_text() == "<svg>mine</svg>"


def test_mermaid_is_text_with_every_wire(network):
    text = """
run: {stop: 1, step: 0.1}
blocks:
  a: {block: Sine}
  end: {expression: "if(a > 0, a, 1)", inputs: {a: a.y}}
"""
    lines = mermaid(network(text)).splitlines()
    assert lines[1] == "flowchart LR"
    assert lines[3] == '  b1(["<b>end</b><br>y = if(a #62; 0, a, 1)"])'
    assert lines[-1] == '  b0 -->|"y → a"| b1'


def test_without_matplotlib_it_is_told(network, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib", None)
    with pytest.raises(PlotError, match="matplotlib"):
        printed.figure(shapes.drawing(network(LOOP)))


def test_a_program_draws_too(tmp_path):
    picture = cosim.load(DIAGRAMS / "motor.yaml").draw(tmp_path / "motor.svg")
    assert (tmp_path / "motor.svg").read_text() == picture.svg
