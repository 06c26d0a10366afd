"""Variants of a study, and the study itself, add to the lists of a diagram."""

import pytest

from cosim.errors import DiagramErrors, WrongValue
from cosim.study.dotted_paths import short_name
from cosim.study.variants import Variants


def recorded(loaded, name):
    return [str(signal) for signal in Variants(loaded).base(name).recorded]


def test_a_variant_adds_to_a_list_by_an_overlay_or_a_setting(study):
    text = """
        diagram: diagram.yaml
        record: true
        variants:
          plain:
          over: {record: {signals+: [swing.v]}}
          set: {set: {record.signals+: [lag.y]}}
    """
    loaded = study(text)
    assert recorded(loaded, "plain") == ["lag.x", "swing.x"]
    assert recorded(loaded, "over") == ["lag.x", "swing.x", "swing.v"]
    assert recorded(loaded, "set") == ["lag.x", "swing.x", "lag.y"]


def test_a_study_records_more_than_its_diagram(study):
    assert recorded(study("{diagram: diagram.yaml, record: {signals+: [swing.v]}}"), "base")[2:] == ["swing.v"]
    loaded = study("{diagram: diagram.yaml, record: {signals: [swing.v]}}", settings=("record.signals+=[lag.x]",))
    assert recorded(loaded, "base") == ["swing.v", "lag.x"]


def test_what_cannot_be_added_to_is_a_mistake(study):
    loaded = study("{diagram: diagram.yaml, variants: {a: {run: {order+: [lag]}}}}")
    with pytest.raises(DiagramErrors) as caught:
        Variants(loaded).base("a")
    assert isinstance(caught.value.errors[0], WrongValue) and "there is none" in caught.value.errors[0].message


def test_an_axis_of_constants_is_called_by_block_and_input():
    assert short_name("blocks.lag.inputs.u") == "lag.u"
    assert short_name("blocks.lag.period") == "blocks.lag.period"
