"""The C files of an FMU compile to what its binaries compute, to the last bit of its whole state."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from importlib import util
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from lxml import etree

from cosim.engine import run
from cosim.errors import NotExportable
from cosim.export import build
from cosim.export.c_code.llvm_reader import Untranslatable
from cosim.export.exporter import export_fmu
from tests.compiling import test_arithmetic
from tests.engine.test_loops import BLOCKS as LOOPED
from tests.export.test_exported_values import FLEET, LOOPS
from tests.fmu.fmu_host import Host

VERSIONS = ("2.0", "3.0")
STEP = 0.1
COMPILERS = {"gcc": ["gcc", "-O2"], "gcc, for this processor": ["gcc", "-O3", "-march=native", "-std=gnu17"]}
if util.find_spec("ziglang"):
    COMPILERS["clang"] = [sys.executable, "-m", "ziglang", "cc", "-O1"]


@pytest.fixture(scope="module")
def networks(tmp_path_factory):
    folder = tmp_path_factory.mktemp("networks")
    (folder / "own.py").write_text(LOOPED)
    for name, text in (("fleet", FLEET), ("loops", LOOPS)):
        (folder / f"{name}.yaml").write_text(text)
    return {name: run.load(folder / f"{name}.yaml") for name in ("fleet", "loops")}


@pytest.fixture(scope="module")
def fmus(networks, tmp_path_factory):
    """With sources, exported on demand, each once."""
    folder = tmp_path_factory.mktemp("sources")
    made: dict[tuple[str, str], Path] = {}

    def get(name: str, version: str) -> Path:
        if (name, version) not in made:
            path = folder / f"{name}{version[0]}.fmu"
            made[name, version] = export_fmu(networks[name], [], path, version, with_sources=True)
        return made[name, version]

    return get


def compiled(path: Path, folder: Path, command: list[str]) -> Path:
    """The FMU with a binary made of its sources in the place of its own."""
    with zipfile.ZipFile(path) as archive:
        archive.extractall(folder)
    (library,) = folder.glob("binaries/*/*")
    library.unlink()
    words = [*command, "-shared", "-fPIC", "-fvisibility=hidden", f"-I{build.headers()}"]
    subprocess.run([*words, folder / "sources" / f"{path.stem}.c", "-o", library, "-lm"], check=True)
    return repacked(folder)


def repacked(folder: Path) -> Path:
    new = folder.with_suffix(".fmu")
    with zipfile.ZipFile(new, "w") as archive:
        for file in folder.rglob("*"):
            archive.write(file, file.relative_to(folder))
    return new


def states(path: Path, steps: int, **more) -> list[bytes]:
    """All that an instance knows, at the begin and after every step."""
    host = Host(path, **more).initialize()
    found = [bytes(host.state())]
    for k in range(steps):
        host.step(k * STEP, STEP)
        found.append(bytes(host.state()))
    host.free()
    return found


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", ["fleet", "loops"])
def test_sources_compute_the_same_bits(fmus, tmp_path, name, version, compiler):
    if not shutil.which(COMPILERS[compiler][0]):
        pytest.skip("there is no such compiler")
    path = fmus(name, version)
    again = compiled(path, tmp_path / "again", COMPILERS[compiler])
    ours, theirs = (states(p, 10) for p in (again, path))
    assert ours == theirs
    assert len(set(theirs)) == 11


def test_sources_of_the_formation_compute_the_same_bits(formation, tmp_path):
    """All kinds of kernels: sums, powers, exponentials, searches in grids, errors that blocks raise."""
    path = export_fmu(run.load(formation), [], tmp_path / "formation.fmu", with_sources=True)
    again = compiled(path, tmp_path / "again", ["gcc", "-O1"])
    hosts = [Host(p).initialize() for p in (again, path)]
    for k in range(200):
        for host in hosts:
            host.step(k * 1e-3, 1e-3)
        assert bytes(hosts[0].state()) == bytes(hosts[1].state()), k
    for host in hosts:
        host.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_faults_and_derivatives_are_those_of_the_binary(fmus, tmp_path, version):
    path = fmus("loops", version)
    again = compiled(path, tmp_path / "again", ["gcc", "-O2"])
    said = []
    for one in (again, path):
        host = Host(one, me=True).initialize()
        host.new_discrete_states()
        host.fmu.enterContinuousTimeMode()
        v = host.variables["mass.v"].valueReference
        a = host.variables["mass.a"].valueReference
        more = [1] if version == "3.0" else []
        said.append(np.array(host.fmu.getDirectionalDerivative([a], [v], [1.0], *more)).tobytes())
        host.fmu.reset()
        with pytest.raises(Exception, match="failed with status"):
            host.initialize(**{"a.k": 4.0, "b.k": 0.25})
        said.append(host.messages[-1])
        host.free()
    assert said[:2] == said[2:] and "no solution was found" in said[1]


def test_only_fmis_functions_are_visible_and_only_libc_is_needed(fmus, tmp_path):
    compiled(fmus("loops", "3.0"), tmp_path / "again", ["gcc", "-O2"])
    (library,) = (tmp_path / "again").glob("binaries/*/*")
    shown = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True).stdout
    assert all(line.split()[-1].startswith("fmi3") for line in shown.splitlines())
    needed = subprocess.run(["readelf", "-dW", library], capture_output=True, text=True, check=True).stdout
    names = [line.split("[")[1].split(".so")[0] for line in needed.splitlines() if "(NEEDED)" in line]
    assert {*names} <= {"libm", "libc"}


@pytest.mark.parametrize("version", VERSIONS)
def test_they_are_described_as_the_standard_has_it(fmus, version):
    path = fmus("fleet", version)
    assert validate_fmu(str(path)) == []
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        description = etree.fromstring(archive.read("modelDescription.xml"))
        built = archive.read("sources/buildDescription.xml") if version == "3.0" else b""
        texts = [archive.read(name).decode() for name in names if name.startswith("sources/") and name.endswith("c")]
    main = f"{path.stem}.c"
    assert f"sources/{main}" in names and all(n.count("/") == 2 for n in names if n.startswith("sources/parts"))
    assert not any("fmi2Functions.h" in n or "fmi3Functions.h" in n for n in names)  # the importer has them
    files = [
        [f.get("name") for f in tag.iterfind(".//File")] for tag in description.iter("ModelExchange", "CoSimulation")
    ]
    if version == "2.0":
        assert files == [[main], [main]]
        assert not any("buildDescription" in n for n in names)
    else:
        assert files == [[], []]
        schema = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3BuildDescription.xsd"
        etree.XMLSchema(etree.parse(str(schema))).assertValid(etree.fromstring(built))
        (configuration,) = read_model_description(path).buildConfigurations
        assert configuration.modelIdentifier == path.stem
        assert configuration.sourceFileSets[0].sourceFiles == [main]
    assert not any(str(Path(__file__).parents[2]) in text for text in texts), "no path of the author's machine"


@pytest.mark.skipif(not shutil.which("cmake"), reason="FMPy builds with CMake")
@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_builds_them(fmus, tmp_path, version):
    path = fmus("fleet", version)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "again")
    (library,) = (tmp_path / "again").glob("binaries/*/*")
    library.unlink()
    pytest.importorskip("fmpy.build").build_platform_binary(tmp_path / "again", cmake_options={})
    assert states(repacked(tmp_path / "again"), 3) == states(path, 3)


def test_the_same_blocks_give_the_same_sources(networks, tmp_path):
    one, two = (
        export_fmu(networks["loops"], ["mass"], tmp_path / n / "mass.fmu", with_sources=True).read_bytes()
        for n in ("one", "two")
    )
    assert one == two


def test_names_that_are_also_those_of_parts(networks, tmp_path):
    path = export_fmu(networks["loops"], ["mass"], tmp_path / "model.fmu", with_sources=True)
    assert states(compiled(path, tmp_path / "again", ["gcc"]), 2) == states(path, 2)


def test_a_kernel_that_has_no_c_is_named(networks, tmp_path, monkeypatch):
    def refuse(ir, unit, kernels):
        raise Untranslatable("it calls `llvm.powi.f64.i32`")

    monkeypatch.setattr(build, "translate", refuse)
    monkeypatch.setattr(build.cache, "read", lambda entry: None)
    monkeypatch.setattr(build.cache, "write", lambda entry, code: None)
    with pytest.raises(NotExportable, match=r"there is no C for \w+.*: it calls `llvm.powi.f64.i32`") as caught:
        export_fmu(networks["loops"], ["mass"], tmp_path / "no.fmu", with_sources=True)
    assert caught.value.fix == "leave out --sources" and not (tmp_path / "no.fmu").exists()


def test_all_that_authors_may_compute_with_has_the_same_bits(tmp_path, trajectories):
    """Every operation and function on which both engines agree, for numbers that are special."""
    native, _ = test_arithmetic.run_both(tmp_path, test_arithmetic.REALS, trajectories)
    network = run.load(tmp_path / "d.yaml")
    path = export_fmu(network, [], tmp_path / "all.fmu", with_sources=True)
    host = Host(compiled(path, tmp_path / "again", ["gcc", "-O1"]))
    values = {name: v for name, v in network.components["b"].values.items() if name != "y"}
    got = np.empty_like(native)
    for k in range(len(native)):  # a fleet is exported as one of its members, which is given the values of each
        host.initialize(**{name: v[k] for name, v in values.items()})
        got[k] = host.get("y")
        host.fmu.reset()
    host.free()
    test_arithmetic.assert_equal(native, got, test_arithmetic.REALS)
