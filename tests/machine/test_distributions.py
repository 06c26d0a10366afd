"""What is installed is what importlib.metadata says, which took too long to be asked at every start."""

import sys
from importlib import metadata
from zipfile import ZipFile

import pytest

from cosim.machine import distributions


def test_all_that_is_installed_here_has_its_version():
    found = distributions.everywhere()
    assert {d.name.lower().replace("-", "_").replace(".", "_") for d in metadata.distributions()} == {*found}
    assert {name: one.version for name, one in found.items()} == {name: metadata.version(name) for name in found}
    asked = distributions.versions("numba", "Ruamel.YAML-none")
    assert asked == {"numba": metadata.version("numba"), "Ruamel.YAML-none": ""}


def test_all_groups_of_entry_points_here_are_the_same():
    groups = {point.group for d in metadata.distributions() for point in d.entry_points}
    assert {"cosim.blocks", "console_scripts"} <= groups
    for group in groups:
        known = {(p.name, p.value, p.module) for p in metadata.entry_points(group=group)}
        assert {(p.name, p.value, p.module) for p in distributions.entry_points(group)} == known


@pytest.mark.parametrize("archived", [False, True])
def test_the_first_of_a_name_counts_and_what_cannot_be_read_does_not(tmp_path, monkeypatch, archived):
    texts = {
        "acme_motors-2.0.dist-info/METADATA": "Name: acme.motors\nVersion: 2.0\n\nVersion: 9\n",
        "acme_motors-2.0.dist-info/entry_points.txt": "# ours\n[x]\na = b\n[cosim.blocks]\nacme = acme.m:all [more]\n",
        "bare-1.dist-info/METADATA": "Name: bare\n",
    }
    first, second = tmp_path / "first", tmp_path / "second"
    second.mkdir()
    (second / "Acme.Motors.egg-info").mkdir()
    (second / "Acme.Motors.egg-info" / "PKG-INFO").write_text("Version: 1.0\n")
    if archived:
        with ZipFile(first, "w") as archive:
            for name, text in texts.items():
                archive.writestr(name, text)
    else:
        for name, text in texts.items():
            (first / name).parent.mkdir(parents=True, exist_ok=True)
            (first / name).write_text(text)
    (tmp_path / "broken").write_text("no archive")
    monkeypatch.setattr(sys, "path", [str(tmp_path / "none"), str(tmp_path / "broken"), str(first), str(second)])
    assert metadata.version("acme-motors") == "2.0"
    assert distributions.versions("acme-motors", "bare") == {"acme-motors": "2.0", "bare": ""}
    points = distributions.entry_points("cosim.blocks")
    assert [(p.name, p.module) for p in points] == [("acme", "acme.m")]
    assert [(p.name, p.value) for p in metadata.entry_points(group="cosim.blocks")] == [
        (p.name, p.value) for p in points
    ]
