"""Exported FMUs keep to the standards: who may call what when, states, logs, parameters, types, no Python."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from cosim.engine import run
from cosim.errors import CompilerMissing, NotExportable, UnknownBlock, WrongValue
from cosim.export import build
from cosim.export.exporter import export_fmu
from cosim.fmu.versions import FMI3
from cosim.machine import c_compiler
from tests.fmu.fmu_host import Host

BLOCKS = Path(__file__).with_name("blocks_for_tests.py")
STEP = 0.01
DIAGRAM = f"""
run: {{stop: 1, step: {STEP}}}
blocks:
  robot: {{python: {BLOCKS}:Robot, inputs: {{u: wave.y}}}}
  filter: {{python: {BLOCKS}:Filter, inputs: {{u: robot.x}}}}
  wave: {{python: {BLOCKS}:Wave}}
  counter: {{python: {BLOCKS}:Counter, period: 0.03, inputs: {{u: wave.y}}}}
  types: {{python: {BLOCKS}:Types}}
  picky: {{python: {BLOCKS}:Picky}}
  far: {{python: {BLOCKS}:Far}}
  plain: {{python: {BLOCKS}:Plain}}
"""
VERSIONS = ("2.0", "3.0")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("standard")


@pytest.fixture(scope="module")
def network(folder):
    path = folder / "diagram.yaml"
    path.write_text(DIAGRAM)
    return run.load(path)


@pytest.fixture(scope="module")
def fmus(network, folder):
    """Exported on demand, each once."""
    made: dict[tuple[str, str], Path] = {}

    def get(block: str, version: str) -> Path:
        if (block, version) not in made:
            made[block, version] = export_fmu(network, [block], folder / f"{block}_{version[0]}.fmu", version)
        return made[block, version]

    return get


@pytest.fixture
def host(fmus):
    """Instances that are freed at the end."""
    hosts = []

    def make(block: str, version: str, **more) -> Host:
        hosts.append(Host(fmus(block, version), **more))
        return hosts[-1]

    yield make
    for one in hosts:
        one.free()


# ---- the state machine ------------------------------------------------------------------------------------------

ILLEGAL_BEFORE_INITIALIZATION = {
    "2.0": {
        "exitInitializationMode": lambda h: h.fmu.exitInitializationMode(),
        "doStep": lambda h: h.step(0, STEP),
        "terminate": lambda h: h.fmu.terminate(),
        "getReal": lambda h: h.get("x"),
        "setReal": lambda h: h.set("der(x)", [0, 0]),
    },
    "3.0": {
        "exitInitializationMode": lambda h: h.fmu.exitInitializationMode(),
        "doStep": lambda h: h.step(0, STEP),
        "terminate": lambda h: h.fmu.terminate(),
        "setFloat64": lambda h: h.set("der(x)", [0, 0]),
        "enterEventMode": lambda h: h.fmu.enterEventMode(),
        "enterStepMode": lambda h: h.fmu.enterStepMode(),
        "enterConfigurationMode": lambda h: h.fmu.enterConfigurationMode(),
    },
}
ILLEGAL_BETWEEN_STEPS = {
    "2.0": {
        "enterInitializationMode": lambda h: h.fmu.enterInitializationMode(),
        "setupExperiment": lambda h: h.fmu.setupExperiment(),
        "setReal of a state": lambda h: h.set("x", [0, 0]),
        "getReal after setReal": lambda h: (h.set("u", [0, 0]), h.get("der(x)")),
        "doStep backwards": lambda h: h.step(-STEP, STEP),
        "doStep of nothing": lambda h: h.step(0, 0.0),
        "doStep beyond the end": lambda h: h.step(0, 2.0),
        "an unknown variable": lambda h: h.fmu.getReal([9999]),
        "an integer that is none": lambda h: h.fmu.getInteger([2]),
    },
    "3.0": {
        "enterInitializationMode": lambda h: h.fmu.enterInitializationMode(),
        "enterEventMode without event mode": lambda h: h.fmu.enterEventMode(),
        "setFloat64 of a state": lambda h: h.set("x", [0, 0]),
        "getFloat64 after setFloat64": lambda h: (h.set("u", [0, 0]), h.get("der(x)")),
        "doStep backwards": lambda h: h.step(-STEP, STEP),
        "doStep beyond the end": lambda h: h.step(0, 2.0),
        "an unknown variable": lambda h: h.fmu.getFloat64([9999]),
        "too many values": lambda h: h.fmu.getFloat64([1], 5),
        "too few values": lambda h: h.fmu.setFloat64([h.variables["u"].valueReference], [1.0]),
        "a wrong type": lambda h: h.fmu.getInt32([2]),
    },
}


@pytest.mark.parametrize(
    ("version", "call"), [(v, c) for v, calls in ILLEGAL_BEFORE_INITIALIZATION.items() for c in calls]
)
def test_calls_before_initialization_that_are_refused(host, version, call):
    one = host("robot", version)
    with pytest.raises(FMICallException):
        ILLEGAL_BEFORE_INITIALIZATION[version][call](one)
    assert one.messages, "the reason is logged"
    one.fmu.reset()
    one.initialize().step(0, STEP)


@pytest.mark.parametrize(("version", "call"), [(v, c) for v, calls in ILLEGAL_BETWEEN_STEPS.items() for c in calls])
def test_calls_between_steps_that_are_refused(host, version, call):
    one = host("robot", version).initialize(stop=1.0)
    before = len(one.messages)
    with pytest.raises(FMICallException):
        ILLEGAL_BETWEEN_STEPS[version][call](one)
    assert len(one.messages) > before
    with pytest.raises(FMICallException):  # an error is an error until reset
        one.step(0, STEP)
    one.fmu.reset()
    one.initialize().step(0, STEP)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("size", [1e19 * STEP, 1e298])
def test_a_step_of_more_steps_than_can_be_counted_is_none(host, version, size):
    one = host("robot", version).initialize(u=[1.0, 0.0])
    with pytest.raises(FMICallException):
        one.step(0, size)
    assert "too many steps" in one.messages[-1]
    one.step(0, STEP)


@pytest.mark.parametrize("version", VERSIONS)
def test_functions_of_the_other_kind_are_refused(host, version):
    me = host("robot", version, me=True).initialize()
    with pytest.raises(FMICallException):
        me.set_states(np.zeros(4))  # in Event Mode
    assert "in Event Mode" in me.messages[-1]
    assert me.fmu.dll  # and FMPy's component class has no such functions to call


def test_parameters_and_states_are_set_in_the_phases_that_fmi_3_allows(host):
    one = host("robot", "3.0", me=True).initialize()
    one.set("mass", 4.0)
    one.set("x", [1.0, 2.0])
    one.new_discrete_states()
    one.fmu.enterContinuousTimeMode()
    one.set("x", [3.0, 4.0])
    np.testing.assert_array_equal(one.states(4)[:2], [3.0, 4.0])
    with pytest.raises(FMICallException):
        one.set("mass", 5.0)


def test_termination_leaves_values_readable(host):
    for version in VERSIONS:
        one = host("filter", version).initialize(u=[1.0, 2.0])
        one.step(0, STEP)
        one.fmu.terminate()
        assert one.get("y").shape == (2,)
        with pytest.raises(FMICallException):
            one.set("u", [0, 0])


# ---- values -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", VERSIONS)
def test_parameters_act_through_calculate_at_once(host, version):
    one = host("robot", version, me=True).initialize(u=[1.0, 0.0], mass=4.0)
    assert one.get("inverse") == 0.25
    slow = one.derivatives(4)[2]
    one.set("mass", 0.5)
    assert one.get("inverse") == 2.0
    assert one.derivatives(4)[2] - 0.1 == pytest.approx(8 * (slow - 0.1), rel=1e-14)


@pytest.mark.parametrize("version", VERSIONS)
def test_start_functions_yield_to_values_that_were_set(host, version):
    computed = host("filter", version).initialize(u=[1.0, 2.0])
    np.testing.assert_array_equal(computed.get("z"), [1.0, 2.0])
    given = host("filter", version).initialize(u=[1.0, 2.0], z=[5.0, 6.0])
    np.testing.assert_array_equal(given.get("z"), [5.0, 6.0])
    np.testing.assert_array_equal(given.get("slow"), [5.0, 6.0])
    given.fmu.reset()
    given.initialize(u=[3.0, 4.0])
    np.testing.assert_array_equal(given.get("z"), [3.0, 4.0])


def test_single_elements_of_a_started_state_can_be_given_in_fmi_2(host):
    one = host("filter", "2.0").initialize(**{"u": [1.0, 2.0], "z[2]": 6.0})
    np.testing.assert_array_equal(one.get("z"), [1.0, 6.0])


@pytest.mark.parametrize("version", VERSIONS)
def test_initial_outputs_follow_inputs_in_initialization_mode(host, version):
    one = host("filter", version)
    if version == "2.0":
        one.fmu.setupExperiment()
    one.fmu.enterInitializationMode()
    for u in ([1.0, 2.0], [3.0, -1.0]):
        one.set("u", u)
        np.testing.assert_array_equal(one.get("z"), u)
        np.testing.assert_array_equal(one.get("y"), u)
        np.testing.assert_array_equal(one.get("der(z)"), [0.0, 0.0])
    one.fmu.exitInitializationMode()
    np.testing.assert_array_equal(one.get("y"), [3.0, -1.0])


@pytest.mark.parametrize("version", VERSIONS)
def test_every_data_type(host, version):
    one = host("types", version)
    types = {name: v.type for name, v in one.variables.items()}
    if version == "3.0":
        assert (types["a"], types["b"], types["c"], types["total"]) == ("Int32", "Boolean", "Float32", "Int64")
    else:
        assert (types["a"], types["b[1]"], types["c"], types["total"]) == ("Integer", "Boolean", "Real", "Integer")
    one.initialize()
    assert (one.get("total"), one.get("both"), one.get("c_out"), one.get("d_out")) == (6, 0, 0.5, 7)
    for name, value in {"a": -5, "b": [True, True], "c": 0.25, "d": 255, "k": 3}.items():
        one.set(name, value)
    one.step(0, STEP)
    assert (one.get("total"), one.get("both"), one.get("c_out"), one.get("d_out")) == (-15, 1, 0.25, 255)


def test_fmi_2_refuses_an_integer_that_does_not_fit(host):
    one = host("types", "2.0")
    with pytest.raises(FMICallException):
        one.set("d", 256)
    assert "`d` cannot be 256" in one.messages[-1]


def test_units_and_descriptions_are_carried_over(host):
    one = host("robot", "3.0")
    assert one.variables["x"].unit == "m"
    assert one.variables["x"].description == "position"
    assert one.variables["der(v)"].unit == "m/s2"
    units = {u.name: u.baseUnit for u in one.description.unitDefinitions}
    assert (units["m/s2"].m, units["m/s2"].s, units["1/kg"].kg) == (1, -2, -1)
    assert host("robot", "2.0").variables["friction[2]"].unit == "1/s"


@pytest.mark.parametrize("version", VERSIONS)
def test_dependencies_tell_direct_feedthrough(host, version):
    one = host("filter", version)
    found = {u.variable.name: {d.name for d in u.dependencies} for u in one.description.outputs}
    if version == "3.0":
        assert found == {"y": {"u", "z"}, "slow": {"z"}}
    else:
        assert found["slow[1]"] == {"z[1]", "z[2]"}
        assert found["y[2]"] == {"u[1]", "u[2]", "z[1]", "z[2]"}


# ---- FMU states, instances --------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("block", ["robot", "counter"])
def test_a_serialized_state_goes_back_bit_by_bit(fmus, host, version, block):
    def steps(one: Host, first: int) -> bytes:
        found = []
        for k in range(first, first + 20):
            one.set("u", [0.1 * k, -0.2 * k])
            one.step(k * STEP, STEP)
            found += [one.get(name) for name in ("x", "v") if block == "robot"] or [one.get("y"), one.get("count")]
        return np.concatenate(found).tobytes()

    one = host(block, version).initialize()
    steps(one, 0)
    data = one.state()
    first = steps(one, 20)
    one.restore(data)
    assert steps(one, 20) == first
    other = host(block, version)  # in another instance that was never initialized
    other.restore(data)
    assert steps(other, 20) == first


@pytest.mark.parametrize("version", VERSIONS)
def test_states_that_do_not_fit_are_refused(host, version):
    one, other = host("robot", version).initialize(), host("counter", version).initialize()
    for data in (other.state(), one.state()[:-1], bytes(len(one.state()))):
        with pytest.raises(FMICallException):
            one.restore(data)
        assert any("no FMU state" in message for message in one.messages + other.messages)  # FMPy has one log for all
        one.messages.clear()
        other.messages.clear()
        one.fmu.reset()
        one.initialize()


@pytest.mark.parametrize("version", VERSIONS)
def test_instances_on_threads_do_not_disturb_each_other(fmus, version):
    def last(push: float) -> bytes:
        one = Host(fmus("robot", version)).initialize(u=[push, 0.0])
        for k in range(300):
            one.step(k * STEP, STEP)
        x = one.get("x").tobytes()
        one.free()
        return x

    pushes = [0.1 * k for k in range(6)]
    alone = [last(push) for push in pushes]
    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(last, pushes)) == alone
    assert len(set(alone)) == len(alone)


@pytest.mark.parametrize("version", VERSIONS)
def test_another_models_token_is_refused(fmus, version):
    with pytest.raises(Exception, match="instantiate"):
        Host(fmus("robot", version), token="{00000000-0000-0000-0000-000000000000}")


# ---- faults -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", VERSIONS)
def test_a_blocks_exception_reaches_the_log(host, version):
    one = host("picky", version).initialize()
    one.step(0, STEP)
    one.set("u", 2.0)
    with pytest.raises(FMICallException):
        one.step(STEP, STEP)
    place = f"blocks_for_tests.py:{line_of('raise ValueError')}"
    assert (
        one.messages[-1] == f"picky: ValueError: the input is too large (## 1) ({place}) in derivatives() at t = 0.01 s"
    )
    one.fmu.reset()
    one.initialize().step(0, STEP)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("index", [2, -3, 10**9])
def test_an_index_out_of_bounds_ends_in_an_error_with_a_text(host, version, index):
    one = host("far", version).initialize()
    one.step(0, STEP)
    one.set("u", -1.0)
    one.step(STEP, STEP)
    assert one.get("y").tolist() == [1.0, 3.0]  # counted from the end
    one.set("u", float(index))
    with pytest.raises(FMICallException):
        one.step(2 * STEP, STEP)
        one.get("y")
    said = f"far: IndexError: index {index} is out of bounds for axis 0 of `y`, size 2"
    assert one.messages[-1].startswith(f"{said} (blocks_for_tests.py:{line_of('y[int(u)]')}) in outputs() at t = 0.0")
    one.fmu.reset()
    one.initialize().step(0, STEP)


def line_of(text: str) -> int:
    """Where a text stands in the file of blocks."""
    return next(n for n, line in enumerate(BLOCKS.read_text().splitlines(), 1) if text in line)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_that_explodes_is_named(host, version):
    one = host("picky", version).initialize(rate=1e200)
    with pytest.raises(FMICallException):
        for k in range(9):
            one.step(k * STEP, STEP)
    assert "`x` is not finite, or beyond 1e100, at t = 0.0" in one.messages[-1]


@pytest.mark.parametrize("version", VERSIONS)
def test_sampled_blocks_reject_steps_off_their_grid_and_go_on(host, version):
    one = host("counter", version).initialize()
    with pytest.raises(FMICallException, match="2 \\(discard\\)"):
        one.step(0, 0.015)
    one.step(0, 0.03)
    assert one.get("count") == 1


def test_what_cannot_be_exported_is_named(network, folder):
    with pytest.raises(NotExportable, match="block plain: Plain is plain Python"):
        export_fmu(network, ["plain"], folder / "no.fmu")
    with pytest.raises(UnknownBlock, match="no block `robt`"):
        export_fmu(network, ["robt"], folder / "no.fmu")
    with pytest.raises(NotExportable, match="FMI 1"):
        export_fmu(network, ["robot"], folder / "no.fmu", "1.0")
    with pytest.raises(NotExportable, match="no platform `linux`"):
        export_fmu(network, ["robot"], folder / "no.fmu", platforms=["linux"])
    assert not (folder / "no.fmu").exists()


def test_only_members_of_the_fleet_can_be_exported(formation, folder):
    with pytest.raises(WrongValue, match="there is no robot 7 in a fleet of 6"):
        export_fmu(run.load(formation), ["plant"], folder / "no.fmu", member=7)


def test_a_missing_compiler_says_what_to_install(network, folder, monkeypatch):
    monkeypatch.setattr(c_compiler.shutil, "which", lambda name: None)
    monkeypatch.setattr(c_compiler.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(CompilerMissing, match="no C compiler") as caught:
        build.compiler(build.host())
    assert "install gcc" in caught.value.fix and "ziglang" in caught.value.fix


MAGIC = {"linux": b"\x7fELF", "windows": b"MZ", "darwin": b"\xcf\xfa\xed\xfe"}


@pytest.mark.parametrize("name", ["linux-aarch64", "windows-x86_64"])
def test_other_platforms_are_built_with_zig(network, folder, name):
    pytest.importorskip("ziglang")
    path = export_fmu(network, ["picky"], folder / f"{name}.fmu", "3.0", platforms=[name, build.host().name])
    platform = build.PLATFORMS[name]
    with zipfile.ZipFile(path) as archive:
        library = archive.read(f"binaries/{platform.folder(FMI3)}/{path.stem.replace('-', '_')}{platform.suffix}")
        assert len(archive.namelist()) == 4
    assert library.startswith(MAGIC[platform.system])


def test_the_same_blocks_give_the_same_file(network, folder):
    one, two = (export_fmu(network, ["robot"], folder / n / "robot.fmu").read_bytes() for n in ("one", "two"))
    assert one == two


# ---- without Python ---------------------------------------------------------------------------------------------


def test_a_c_program_runs_it_with_an_empty_environment(fmus, host, tmp_path):
    one = host("robot", "3.0")
    library = Path(one.folder, "binaries", build.host().folder(FMI3), f"robot_3{build.host().suffix}")
    program = tmp_path / "host"
    code = Path(__file__).with_name("host.c")
    subprocess.run(["cc", "-std=c11", f"-I{build.headers()}", "-o", program, code, "-ldl"], check=True)
    references = [str(one.variables[name].valueReference) for name in ("u", "x")]
    token = one.description.instantiationToken
    command = [shutil.which("env"), "-i", program, library, token, str(STEP), "100", *references]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd="/")
    lines = [line for line in done.stdout.splitlines() if "log" not in line]
    one.initialize()
    for k, line in enumerate(lines):
        one.set("u", [0.01 * k, -1.0])
        one.step(k * STEP, STEP)
        assert [int(word, 16) for word in line.split()] == one.get("x").view(np.uint64).tolist()
    assert len(lines) == 100


def test_the_library_needs_libc_and_libm_only(host):
    one = host("robot", "3.0")
    library = Path(one.folder, "binaries", build.host().folder(FMI3), f"robot_3{build.host().suffix}")
    needed = subprocess.run(["readelf", "-dW", library], capture_output=True, text=True, check=True).stdout
    names = [line.split("[")[1].split(".so")[0] for line in needed.splitlines() if "(NEEDED)" in line]
    assert set(names) <= {"libm", "libc"}
    symbols = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True).stdout
    exported = {line.split()[-1] for line in symbols.splitlines()}
    assert all(name.startswith("fmi3") for name in exported)
    assert b"blocks_for_tests.py" not in library.read_bytes(), "no path of the author's machine"
