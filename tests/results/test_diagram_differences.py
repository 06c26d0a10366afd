"""What differs between diagrams is said key by key, as `--set` takes it, for any number of results."""

import json

import numpy as np
import pytest

from cosim.results import result_names
from cosim.results.diagram_differences import differences
from cosim.results.recorded import Recorded
from cosim.results.result_writer import ResultWriter
from cosim.terminal.cli import main


def found(*diagrams):
    return {item.key: item.values for item in differences(diagrams)}


def test_keys_are_those_of_set_and_only_those_that_differ():
    a = {"run": {"step": 0.001, "stop": 1}, "blocks": {"p": {"parameters": {"m": [1, 2.0, 3]}}}}
    b = {"run": {"step": 0.002, "stop": 1.0}, "blocks": {"p": {"parameters": {"m": [1, 2, 4]}}}}
    assert found(a, b) == {"run.step": (0.001, 0.002), "blocks.p.parameters.m.2": (3, 4)}
    assert found(a, a, a) == {}


def test_what_one_has_not_at_all_is_one_difference():
    a, b = {"blocks": {"p": {"block": "P", "per": "robot"}}}, {"blocks": {}}
    assert found(a, b, a) == {"blocks.p": ({"block": "P", "per": "robot"}, None, {"block": "P", "per": "robot"})}
    assert differences([a, b])[0].texts == ("P", "—")


@pytest.mark.parametrize(
    ("a", "b", "same"),
    [(True, 1, False), (1, 1.0, True), ("1", 1, False), (float("nan"), float("nan"), True), ([1, [2]], [1, [2]], True)],
)
def test_values_are_compared_as_what_they_are(a, b, same):
    assert (not differences([{"k": a}, {"k": b}])) == same


def test_an_expression_is_told_by_its_output_and_as_a_type():
    a = {"blocks": {"p": {"expression": {"r": "hypot(x, y)", "phi": "atan2(y, x)"}}, "q": {"expression": "2*x"}}}
    b = {"blocks": {"p": {"expression": {"r": "hypot(x, y)", "phi": "0*x"}}, "q": {"block": "Gain"}}}
    assert found(a, b) == {
        "blocks.p.expression.phi": ("atan2(y, x)", "0*x"),
        "blocks.q.expression": ("2*x", None),
        "blocks.q.block": (None, "Gain"),
    }
    assert differences([a, {"blocks": {}}])[0].texts == ("{r: hypot(x, y), phi: atan2(y, …", "—")


def test_lists_of_other_sizes_are_one_difference_and_of_names_those_that_not_all_have():
    (item,) = differences([{"k": [1, 2]}, {"k": [1, 2, 3]}])
    assert item.texts == ("[1, 2]", "[1, 2, 3]")
    (item,) = differences([{"k": ["a.x", "b.y"]}, {"k": ["a.x"]}, {"k": ["a.x", "c.z", "b.y"]}])
    assert item.texts == ("… b.y", "…", "… c.z, b.y")


def test_long_values_are_shortened_but_never_to_the_same():
    (item,) = differences([{"k": "x" * 60 + "1"}, {"k": "x" * 60 + "2"}])
    assert item.texts == ("x" * 60 + "1", "x" * 60 + "2")
    (item,) = differences([{"k": "a" * 60}, {"k": "b"}])
    assert len(item.texts[0]) == 32


def test_what_changes_the_run_comes_first():
    a = {"title": "a", "metrics": {"m": 1}, "run": {"step": 1}}
    b = {"title": "b", "metrics": {"m": 2}, "run": {"step": 2}}
    assert list(found(a, b)) == ["run.step", "title", "metrics.m"]


def test_results_are_called_as_shortly_as_tells_them_apart(tmp_path):
    paths = [tmp_path / name for name in ("a/run.nc", "b/run.nc", "other.nc", "other.nc")]
    assert result_names.names(paths) == ["a/run", "b/run", str(paths[2]), f"{paths[2]} (2)"]
    assert result_names.names([tmp_path / "x.nc", tmp_path / "y.nc"]) == ["x", "y"]


@pytest.fixture
def result(tmp_path):
    def write(name, step, value=1.0, diagram="run: {{step: {}}}\nblocks: {{ü: {{block: A_$%&}}}}"):
        path = tmp_path / f"{name}.nc"
        writer = ResultWriter(path, [Recorded("b.y")], {"diagram": diagram.format(step)} if diagram else {})
        writer.append(np.arange(3.0), {"b.y": np.full(3, value)})
        writer.close("completed", metrics={"m_1": value})
        return str(path)

    return write


@pytest.mark.parametrize("width", [80, 120])
@pytest.mark.parametrize("count", [2, 3, 5, 30])
def test_any_number_of_results_is_compared_within_the_terminal(result, capsys, monkeypatch, width, count):
    monkeypatch.setenv("COLUMNS", str(width))
    paths = [result(f"run{k}", 0.001 * (k + 1), 1.0 + k) for k in range(count)]
    assert main(["compare", *paths]) == 1
    text = capsys.readouterr().out
    assert "run.step" in text and "0.002" in text and "blocks.ü" not in text
    shown = text.replace(str(paths[0].rpartition("/")[0]), "")  # of two, whole paths are named
    assert max(map(len, shown.splitlines())) <= width
    assert main(["compare", *paths[:1], *paths[:1] * (count - 1)]) == 0


def test_one_of_many_that_differs_makes_the_exit_code(result, capsys):
    a, b, c = result("a", 1), result("b", 1), result("c", 1, 2.0)
    assert main(["compare", a, b]) == 0
    assert "their diagrams are the same, key by key" in capsys.readouterr().out
    assert main(["compare", a, b, c]) == 1
    text = capsys.readouterr().out
    assert "b  the same, bit by bit" in text and "c  differs: b.y by more than 1e-06" in text
    assert main(["compare", a, b, c, "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert [pair["agree"] for pair in told["comparisons"]] == [True, False] and told["differences"] == {}


def test_a_result_without_a_diagram_is_said(result, capsys):
    assert main(["compare", result("a", 1), result("b", 1, diagram="")]) == 0
    assert "b says nothing of its diagram" in capsys.readouterr().out
    assert main(["compare", result("a", 1), result("b", 1, diagram="{{[")]) == 0
    assert "b says nothing of its diagram" in capsys.readouterr().out


def test_the_metrics_as_a_table_of_latex(result, capsys):
    assert main(["compare", result("a_1", 1), result("b&c", 1), "--latex"]) == 0
    text = capsys.readouterr().out
    assert r"metric & a\_1 & b\&c & change \\" in text and r"m\_1 & $1.000$ & $1.000$ & same \\" in text
