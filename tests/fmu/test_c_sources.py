"""FMUs that come as C sources: what is compiled and how, once, and what is said where it cannot be."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.errors import BuildFailed, CompilerMissing, DiagramErrors, FmuError
from cosim.fmu import archive, c_sources, inspect
from cosim.machine import c_compiler
from tests.fmu import machine, told

pytestmark = pytest.mark.skipif(not c_compiler.native(), reason="there is no C compiler")
BUILD = """<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">{configurations}</fmiBuildDescription>"""
ONE_SET = """<BuildConfiguration modelIdentifier="told" {more}><SourceFileSet language="C99">
<SourceFile name="told.c"/><PreprocessorDefinition name="FMI" value="{version}"/>
</SourceFileSet>{after}</BuildConfiguration>"""


@pytest.fixture(autouse=True)
def own_cache(new_cache):
    """A cache of object code for each test."""


@pytest.fixture
def compiled(monkeypatch):
    """The commands that the compiler is called with."""
    commands: list[list[str]] = []
    real = c_compiler.complaints

    def noted(words):
        commands.append([*words])
        return real(words)

    monkeypatch.setattr(c_compiler, "complaints", noted)
    return commands


def pack(folder: Path, version: int, build: str = "", files: dict[str, str] | None = None, listed: str = "") -> Path:
    """told.fmu without a binary; build: configurations of its build description, listed: FMI 2's source files."""
    interface = f'<CoSimulation modelIdentifier="told">{listed}</CoSimulation>'
    text = (told.description2 if version == 2 else told.description3)(interface)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "told.fmu"
    with zipfile.ZipFile(path, "w") as fmu:
        fmu.writestr("modelDescription.xml", text)
        for name, content in {"told.c": told.SOURCE.read_text(), **(files or {})}.items():
            fmu.writestr(f"sources/{name}", content)
        if build:
            fmu.writestr("sources/buildDescription.xml", BUILD.format(configurations=build))
    return path


def listed(*names: str) -> str:
    """FMI 2's list of source files."""
    rows = "".join(f'<File name="{name}"/>' for name in names)
    return f"<SourceFiles>{rows}</SourceFiles>"


FMI2_FILE = {"all.c": '#define FMI 2\n#include "told.c"\n'}


@pytest.fixture
def load(write):
    """Wire a diagram of one such FMU."""

    def load_one(path: Path, keys: str = ""):
        return run.load(write(f"run: {{stop: 1, step: 0.5}}\nblocks: {{plant: {{fmu: {path}{keys}}}}}\n"))

    return load_one


def mistake(load, path: Path) -> Exception:
    """What is wrong with an FMU."""
    with pytest.raises(DiagramErrors) as caught:
        load(path)
    (error,) = caught.value.errors
    assert error.position.line == 2
    return error


@pytest.mark.parametrize("isolated", ["false", "true"])
def test_fmi3_is_compiled_as_its_build_description_says(load, tmp_path, trajectories, isolated):
    path = pack(tmp_path / "fmu", 3, ONE_SET.format(version=3, more="", after=""))
    assert "no binary for this machine: compiled from its C sources as it is run" in inspect.text(path)
    got = trajectories(load(path, f", isolate: {isolated}, start_time: 8"), "plant.clock", "plant.start")
    assert np.array_equal(got["plant.clock"].ravel(), [8.0, 8.5, 9.0])


def test_fmi2_is_compiled_as_its_list_of_files_says(load, tmp_path, trajectories):
    path = pack(tmp_path / "fmu", 2, files=FMI2_FILE, listed=listed("all.c"))
    got = trajectories(load(path), "plant.clock")
    assert np.array_equal(got["plant.clock"].ravel(), [0.0, 0.5, 1.0])


def test_fmi2_may_have_a_build_description_too(load, tmp_path, trajectories):
    path = pack(tmp_path / "fmu", 2, ONE_SET.format(version=2, more="", after=""))
    assert trajectories(load(path), "plant.clock")["plant.clock"][-1] == 1.0


def test_a_library_is_compiled_once(load, tmp_path, compiled):
    path = pack(tmp_path / "fmu", 3, ONE_SET.format(version=3, more="", after=""))
    load(path)
    assert len(compiled) == 2  # a file, and the library
    archive.unpack.__globals__["_unpacked"].clear()  # as in another process
    load(path)
    assert len(compiled) == 2
    other = pack(tmp_path / "other", 3, ONE_SET.format(version=3, more="", after=""), {"unused.h": "int x;\n"})
    load(other)
    assert len(compiled) == 4
    for entry in (tmp_path / "cache").glob("fmusource-*"):
        entry.write_bytes(entry.read_bytes()[:-1])
    archive.unpack.__globals__["_unpacked"].clear()
    load(path)
    assert len(compiled) == 6  # what is damaged is compiled anew


def test_a_binary_is_taken_where_there_is_one(load, tmp_path, compiled):
    path = told.build(tmp_path / "fmu", 3, "cs")
    with zipfile.ZipFile(path, "a") as fmu:
        fmu.writestr(
            "sources/buildDescription.xml", BUILD.format(configurations=ONE_SET.format(version=3, more="", after=""))
        )
    load(path)
    assert compiled == []


def test_sets_have_their_own_language_definitions_and_folders(load, tmp_path, trajectories, compiled):
    """`half` of one set, in a folder of its own, is defined otherwise than in the other."""
    build = """<BuildConfiguration modelIdentifier="told">
      <SourceFileSet language="C99"><SourceFile name="all.c"/>
        <PreprocessorDefinition name="FMI" value="3"/></SourceFileSet>
      <SourceFileSet language="C11"><SourceFile name="more/half.c"/>
        <PreprocessorDefinition name="HALF" value="0.5"/><PreprocessorDefinition name="BROKEN" optional="true"/>
        <PreprocessorDefinition name="ALONE"/><IncludeDirectory name="include"/></SourceFileSet>
      <Library name="m" external="true"/></BuildConfiguration>"""
    text = told.SOURCE.read_text().replace("case CLOCK: *at = &t->clock", "case CLOCK: t->u = half(); *at = &t->u")
    files = {
        "all.c": "double half(void);\n" + text,
        "more/half.c": '#include "half.h"\n#ifndef ALONE\n#error no\n#endif\n#ifdef BROKEN\n#error no\n#endif\n'
        'double half(void) { _Static_assert(1, "C11"); return HALF_OF_ONE; }\n',
        "include/half.h": "#define HALF_OF_ONE HALF\n",
    }
    got = trajectories(load(pack(tmp_path / "fmu", 3, build, files)), "plant.clock")
    assert {*got["plant.clock"].ravel()} == {0.5}
    assert [("-std=gnu99" in words, "-std=gnu11" in words) for words in compiled] == [(1, 0), (0, 1), (0, 0)]


def test_cplusplus_is_compiled_too(load, tmp_path, trajectories):
    build = """<BuildConfiguration modelIdentifier="told">
      <SourceFileSet language="C99"><SourceFile name="all.c"/>
        <PreprocessorDefinition name="FMI" value="3"/></SourceFileSet>
      <SourceFileSet language="C++17"><SourceFile name="half.cpp"/></SourceFileSet></BuildConfiguration>"""
    text = told.SOURCE.read_text().replace("case CLOCK: *at = &t->clock", "case CLOCK: t->u = half(); *at = &t->u")
    half = '#include <vector>\nextern "C" double half() { std::vector<double> v(3, 0.5); return v.at(1); }\n'
    path = pack(tmp_path / "fmu", 3, build, {"all.c": "double half(void);\n" + text, "half.cpp": half})
    assert {*trajectories(load(path), "plant.clock")["plant.clock"].ravel()} == {0.5}


def test_functions_may_have_the_prefix_of_the_standard(load, tmp_path, trajectories):
    """As FMI asks of sources that are to be linked with others."""
    text = "#define FMI 2\n#define FMI2_FUNCTION_PREFIX told_\n" + told.SOURCE.read_text()
    path = pack(tmp_path / "fmu", 2, files={"all.c": text}, listed=listed("all.c"))
    assert trajectories(load(path), "plant.clock")["plant.clock"][-1] == 1.0


@pytest.mark.parametrize(
    ("configurations", "chosen"),
    [
        ('modelIdentifier="told" platform="riscv-os"|modelIdentifier="told"', 1),
        ('modelIdentifier="told"|modelIdentifier="told" platform="{here}"', 1),
        ('modelIdentifier="other"|modelIdentifier="told"', 1),
        ('modelIdentifier="wrong"', 0),  # of one of the Reference FMUs; there is no other
        ('modelIdentifier="told" platform="riscv-os"', None),
    ],
)
def test_the_configuration_for_this_machine_is_chosen(tmp_path, configurations, chosen):
    from cosim.fmu import versions

    here = archive.platforms(versions.FMI3)[0]
    files = '<SourceFileSet><SourceFile name="{}.c"/></SourceFileSet>'
    rows = [
        f"<BuildConfiguration {attributes.format(here=here)}>{files.format(k)}</BuildConfiguration>"
        for k, attributes in enumerate(configurations.split("|"))
    ]
    path = pack(tmp_path / "fmu", 3, "".join(rows), {"0.c": "", "1.c": ""})
    sets, _ = c_sources.build_description(archive.unpack(path), "told", versions.FMI3)
    assert [one.files for one in sets] == ([(f"{chosen}.c",)] if chosen is not None else [])


def test_a_mistake_in_the_sources_is_told_in_the_compilers_words(load, tmp_path):
    path = pack(tmp_path / "fmu", 3, ONE_SET.format(version=3, more="", after=""), {"told.c": "int x = ;\nint y = ;\n"})
    error = mistake(load, path)
    assert isinstance(error, BuildFailed)
    assert "`told.fmu` has C sources and no binary for" in error.message
    assert "it says sources/told.c:1:9: error: expected expression" in error.message
    assert "export it with a binary" in error.fix
    assert str(tmp_path) not in error.message


def test_a_library_that_is_missing_is_told(load, tmp_path):
    path = pack(tmp_path / "fmu", 3, ONE_SET.format(version=3, more="", after='<Library name="no_such_library"/>'))
    error = mistake(load, path)
    assert isinstance(error, BuildFailed)
    assert "no_such_library" in error.message


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (ONE_SET.replace("told.c", "../../modelDescription.xml"), "lies outside of it"),
        (ONE_SET.replace("told.c", "/etc/passwd"), "its source `/etc/passwd` lies outside of it"),
        (ONE_SET.replace("told.c", "gone.c"), "its source `gone.c` is missing"),
        (ONE_SET.replace("C99", "Ada"), "it is written in Ada; C and C++ can be compiled"),
        (ONE_SET.replace('name="FMI"', 'name="-o/tmp/x"'), "is no definition for a compiler"),
        (ONE_SET.replace("{after}", '<Library name="-Wl,-rpath"/>'), "is no name of a library"),
        (ONE_SET.replace("</SourceFileSet>", '<IncludeDirectory name="../.."/></SourceFileSet>'), "lies outside of it"),
    ],
)
def test_what_leads_out_of_the_fmu_is_refused(load, tmp_path, build, words):
    error = mistake(load, pack(tmp_path / "fmu", 3, build.format(version=3, more="", after="")))
    assert isinstance(error, FmuError)
    assert words in error.message


def test_without_a_compiler_it_says_what_to_install(load, tmp_path, monkeypatch):
    monkeypatch.setattr(c_compiler, "native", list)
    monkeypatch.setattr(c_compiler, "zig", list)
    path = pack(tmp_path / "fmu", 3, ONE_SET.format(version=3, more="", after=""))
    error = mistake(load, path)
    assert isinstance(error, CompilerMissing)
    assert "there is no C compiler" in error.message
    assert "install gcc" in error.fix


def test_sources_that_nothing_is_said_of_are_not_guessed_at(load, tmp_path):
    error = mistake(load, pack(tmp_path / "fmu", 3))
    assert "and C sources of which it does not say how to compile them" in error.message


def test_the_machine_has_the_same_bits_from_sources(tmp_path, partners, trajectories):
    """As from its binary, compiled with the same options; Model Exchange."""
    binary = machine.build(tmp_path / "binary", 3, "me")
    source = tmp_path / "source.fmu"
    with zipfile.ZipFile(source, "w") as fmu, zipfile.ZipFile(binary) as given:
        fmu.writestr("modelDescription.xml", given.read("modelDescription.xml"))
        fmu.writestr("sources/machine.c", machine.SOURCE.read_text())
        build = ONE_SET.replace("told", "machine").format(version=3, more="", after="").replace("C99", "C11")
        fmu.writestr("sources/buildDescription.xml", BUILD.format(configurations=build))
    got = []
    for path in (binary, source):
        text = f"""
            run: {{stop: 1, step: 0.01, integrator: rk4}}
            blocks:
              source: {{type: Source}}
              plant: {{fmu: {path}, inputs: {{u: source.u}}}}
            """
        got.append(trajectories(run.load(partners(text)), "plant.x", "plant.h", "plant.ticks"))
    assert all(np.array_equal(got[0][name], got[1][name]) for name in got[0])
    assert np.ptp(got[0]["plant.x"]) > 0.1
