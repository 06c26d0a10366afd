"""`cosim fmu`: all that a description says of what an FMU can do, and its variables as a diagram has them."""

from __future__ import annotations

import pytest

from cosim.fmu import inspect
from tests.fmu import machine, told

#: By FMI version and kind: an attribute of the standard, its value, the words for it.
ABLE = [
    *[(v, k, name, "true", words) for v, k, name, words in [
        (3, "cs", "canHandleVariableCommunicationStepSize", "takes steps of any size"),
        (3, "cs", "hasEventMode", "event mode"),
        (3, "cs", "mightReturnEarlyFromDoStep", "may return early from a step"),
        (3, "cs", "canReturnEarlyAfterIntermediateUpdate", "can return early after an intermediate update"),
        (3, "cs", "providesIntermediateUpdate", ", intermediate update"),
        (3, "cs", "providesEvaluateDiscreteStates", "evaluates discrete states apart"),
        (3, "me", "providesEvaluateDiscreteStates", "evaluates discrete states apart"),
        (3, "me", "needsCompletedIntegratorStep", "wants to know of completed steps"),
        (3, "me", "canGetAndSetFMUState", "state can be saved and restored"),
        (3, "cs", "canSerializeFMUState", "state can be serialised"),
        (3, "me", "providesDirectionalDerivatives", "directional derivatives"),
        (3, "cs", "providesAdjointDerivatives", "adjoint derivatives"),
        (3, "cs", "providesPerElementDependencies", "dependencies of single elements"),
        (3, "me", "needsExecutionTool", "needs the tool that made it"),
        (3, "me", "canBeInstantiatedOnlyOncePerProcess", "one instance a process"),
        (2, "cs", "canInterpolateInputs", "interpolates inputs"),
        (2, "cs", "canRunAsynchronuously", "can step asynchronously"),
        (2, "cs", "canNotUseMemoryManagementFunctions", "manages its own memory"),
        (2, "me", "canGetAndSetFMUstate", "state can be saved and restored"),
        (2, "me", "canSerializeFMUstate", "state can be serialised"),
        (2, "me", "providesDirectionalDerivative", "directional derivatives"),
    ]],
    (3, "cs", "fixedInternalStepSize", "0.25", "fixed steps of 0.25 s inside"),
    (3, "cs", "maxOutputDerivativeOrder", "2", "derivatives of outputs up to order 2"),
    (3, "cs", "recommendedIntermediateInputSmoothness", "1", "inputs of smoothness 1 recommended"),
    (2, "cs", "maxOutputDerivativeOrder", "2", "derivatives of outputs up to order 2"),
]  # fmt: skip
KINDS = {"cs": "kind      co-simulation", "me": "kind      model-exchange"}


def kind_line(path, kind: str) -> str:
    """What is said of one kind."""
    return next(line for line in inspect.text(path).splitlines() if line.startswith(KINDS[kind]))


@pytest.mark.parametrize(("version", "kind", "name", "value", "words"), ABLE)
def test_every_capability_is_shown(tmp_path, version, kind, name, value, words):
    other = {"true": "false"}.get(value, "0")
    with_it = machine.build(tmp_path / "with", version, kind, f'{name}="{value}"')
    without = machine.build(tmp_path / "without", version, kind, f'{name}="{other}"')
    line = kind_line(with_it, kind)
    assert words.removeprefix(", ") in line
    assert words.removeprefix(", ") not in kind_line(without, kind)


def test_fmi2_says_the_other_way_round_that_it_wants_to_know_of_steps(tmp_path):
    spared = machine.build(tmp_path / "spared", 2, "me", 'completedIntegratorStepNotNeeded="true"')
    assert "completed steps" not in kind_line(spared, "me")
    assert "completed steps" in kind_line(machine.build(tmp_path / "told", 2, "me"), "me")
    assert "completed steps" not in kind_line(machine.build(tmp_path / "cs", 2, "cs"), "cs")


@pytest.mark.parametrize("version", [2, 3])
def test_the_experiment_the_categories_and_the_enumerations_are_shown(tmp_path, version):
    lines = inspect.text(told.build(tmp_path, version, "cs")).splitlines()
    assert "run       from 2 s, to 3 s, in steps of 0.1 s, tolerance 1e-5" in lines
    assert "log       logEvents, logSteps, logStatusWarning" in lines
    assert "  Level: low = 1, very high = 7 (hot), 2 = 3" in lines
    assert any(line.split() == ["heat", "Enumeration", "Level", "start", "low"] for line in lines)
    assert "validation finds no problem" in lines


def test_an_experiment_that_says_nothing_is_not_shown(tmp_path):
    text = inspect.text(told.build(tmp_path, 3, "cs", experiment="<DefaultExperiment/>"))
    assert "\nrun " not in text
    assert "\nrun " not in inspect.text(told.build(tmp_path / "none", 3, "cs", experiment=""))


def test_names_sizes_texts_and_data_are_shown_as_a_diagram_has_them(tmp_path):
    rows = [line.split() for line in inspect.text(told.build(tmp_path, 3, "cs")).splitlines()]
    for row in (
        "zeit Float64 = clock — auch",
        "force Float64 start 0.0 = u",
        "size UInt64 structural start 3",
        "note String an input by FMI, set once start 'none'",
        "words(2) String start ['a', 'b']",
        "blob Binary start '00ff'",
        f"big UInt64 start {2**64 - 1}",
    ):
        assert row.split() in rows, row


def test_what_is_no_port_is_shown_with_the_reason(tmp_path):
    def edit(xml):
        clock = '<Clock name="tick" valueReference="90" causality="local" intervalVariability="triggered"/>'
        clocked = '<Float64 name="held" valueReference="91" causality="local" variability="discrete" clocks="90"/>'
        said = '<String name="said" valueReference="92" causality="output"/>'
        return xml.replace("</ModelVariables>", f"{clock}{clocked}{said}</ModelVariables>")

    text = inspect.text(machine.build(tmp_path, 3, "cs", edit=edit))
    assert "no ports: tick is a clock; held belongs to a clock; said is text, which is no signal" in text
