"""An FMU that is no good guest changes nothing for its neighbours: not their arithmetic, not their rows.

See `guest.c`.
"""

from __future__ import annotations

import ctypes
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.export.exporter import export_fmu
from cosim.fmu import messages
from cosim.machine import floating, supervision
from cosim.results import result_file
from tests.fmu import guest
from tests.fmu.fmu_host import Host

DIAGRAM = """
run: {{stop: 0.6, step: 0.01}}
blocks:
  neighbour: {{type: Sensitive}}
  guest:
    fmu: {fmu}
    isolate: {isolated}
    inputs: {{u: source.u}}
    parameters: {{what: {what}, where: {where}}}
  source: {{type: Source}}
record: {{period: 0.01, signals: [neighbour.x, guest.y]}}
metrics: {{x: {{signal: neighbour.x, reduce: final}}}}
"""
FE_DOWNWARD = {"x86_64": 0x400, "aarch64": 0x800000, "arm64": 0x800000}[os.uname().machine]

pytestmark = pytest.mark.skipif(not supervision.AVAILABLE, reason="FMUs of C for other systems are not built here")


@pytest.fixture(scope="session")
def guests(tmp_path_factory):
    folder = tmp_path_factory.mktemp("guests")
    return {
        "plain": guest.build(folder / "plain"),
        "flushing": guest.build(folder / "flushing", "-DFLUSHES_AS_IT_IS_LOADED"),
    }


@pytest.fixture
def outcome(partners, guests, tmp_path):
    """Run with a guest; the outcome, the times, and the neighbour's and the guest's rows."""

    def rows(what: int, where: int, engine: str = "native", name: str = "plain", isolated: str = "false"):
        path = partners(DIAGRAM.format(fmu=guests[name], what=what, where=where, isolated=isolated))
        output = tmp_path / "result.nc"
        ended = Run(run.load(path), engine, output).execute()
        with result_file.open_result(output) as result:
            return ended, np.array(result.times), np.array(result["neighbour.x"]), np.array(result["guest.y"])

    return rows


def expected() -> np.ndarray:
    """The neighbour's states by IEEE 754's default arithmetic (61, 2): an explicit Euler step each."""
    x = np.array([[0.1, 1e-300]])
    for k in range(60):
        time = k * 0.01
        d = np.array([np.sin(time) - x[-1, 0] / 3.0, -50.0 * x[-1, 1]])
        x = np.vstack([x, x[-1] + 0.01 * d])
    assert 0 < x[-1, 1] < np.finfo(float).tiny
    return x


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("what", [guest.NOTHING, guest.ROUND, guest.FLUSH])
@pytest.mark.parametrize("where", [guest.EVERYWHERE, guest.IN_STEP, guest.IN_GET, guest.IN_SET_UP])
def test_a_guest_that_changes_the_control_word(outcome, what, where, engine):
    ended, times, neighbour, _ = outcome(what, where, engine)
    assert (ended.status, len(times)) == ("completed", 61)
    assert np.array_equal(neighbour, expected())


@pytest.mark.parametrize("engine", ["native", "python"])
def test_a_library_that_changes_the_control_word_as_it_is_loaded(outcome, engine):
    ended, _, neighbour, _ = outcome(guest.NOTHING, 0, engine, "flushing")
    assert ended.status == "completed"
    assert np.array_equal(neighbour, expected())


@pytest.mark.parametrize("engine", ["native", "python"])
def test_what_this_process_has_loaded_before_is_no_matter(partners, trajectories, guests, tmp_path, engine):
    """And the caller's control word is afterwards what it was."""
    with zipfile.ZipFile(guests["flushing"]) as archive:
        library = archive.extract("binaries/linux64/guest.so", tmp_path)
    network = run.load(partners("run: {stop: 0.6, step: 0.01}\nblocks:\n  neighbour: {type: Sensitive}\n"))
    truth = expected()
    fenv = ctypes.CDLL(None)
    with floating.kept():
        ctypes.CDLL(library)
        assert fenv.fegetround() == FE_DOWNWARD
        got = trajectories(network, "neighbour.x", engine=engine)
        rounding = fenv.fegetround()
    assert rounding == FE_DOWNWARD and fenv.fegetround() == 0
    assert np.array_equal(got["neighbour.x"], truth)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_an_exported_fmu_computes_the_same_whatever_the_importers_control_word_is(partners, tmp_path, version):
    path = partners("run: {stop: 0.6, step: 0.01}\nblocks:\n  neighbour: {type: Sensitive}\n")
    host = Host(export_fmu(run.load(path), [], tmp_path / "neighbour.fmu", version)).initialize()
    fenv, found = ctypes.CDLL(None), []
    for k in range(61):
        with floating.kept():
            fenv.fesetround(FE_DOWNWARD)
            found.append(host.get("x"))
            if k < 60:
                host.step(0.01 * k, 0.01)
            rounding = fenv.fegetround()
        assert rounding == FE_DOWNWARD
    host.free()
    assert np.array_equal(found, expected())


# ---- processes, threads, and what belongs to the whole process ----


@pytest.mark.parametrize("isolated", ["false", "true"])
@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize(
    ("what", "where"),
    [
        (guest.FORK, guest.IN_STEP),
        (guest.FORK, guest.IN_SET_UP | guest.IN_TERMINATE | guest.IN_FREE),
        (guest.FORK_EXEC, guest.IN_STEP),
        (guest.ENVIRONMENT, guest.EVERYWHERE),
    ],
)
def test_a_guest_that_forks_or_changes_its_process(outcome, what, where, engine, isolated):
    """Each row is there once, with the bits of a good guest; the outcome is this process's alone."""
    _, times, neighbour, y = outcome(guest.NOTHING, 0)
    folder = Path.cwd()
    ended, *got = outcome(what, where, engine, isolated=isolated)
    assert (ended.status, ended.error) == ("completed", None)
    assert all(np.array_equal(*pair) for pair in zip(got, (times, neighbour, y), strict=True))
    assert np.array_equal(times, 0.01 * np.arange(61))
    assert Path.cwd() == folder


def test_a_guest_whose_threads_talk(outcome):
    ended, _, neighbour, _ = outcome(guest.THREAD, guest.IN_STEP)
    assert np.array_equal(neighbour, expected())
    told = [w.message for w in ended.warnings if "logged" in w.message]
    assert told == ["block guest (guest2.fmu): 12000 warnings logged\n    it says first: said by a thread"]


@pytest.mark.parametrize("version", [2, 3])
def test_a_logger_that_is_called_without_a_text_or_an_environment(version):
    ring = np.zeros(messages.RING_BYTES, np.uint8)
    heard, null = messages.Messages(ring), ctypes.c_void_p()
    kinds = (ctypes.c_void_p, *[ctypes.c_char_p] * (version == 2), ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
    log = ctypes.CFUNCTYPE(None, *kinds)(messages.logger(version))
    name = (b"one",) * (version == 2)
    log(null, *name, 1, b"logAll", b"lost")
    log(heard.environment, *name, 1, None, None)
    log(heard.environment, *name, 3, b"logAll", b"wrong")
    assert heard.last() == ["warning: ", "error: wrong"]
    assert (heard.warnings, heard.first_warning) == (1, "")


def test_a_guest_of_many_words_is_cut_short(outcome):
    ended, _, neighbour, _ = outcome(guest.LONG_MESSAGE, guest.IN_STEP)
    assert np.array_equal(neighbour, expected())
    told = next(w.message for w in ended.warnings if "logged" in w.message)
    assert "120 warnings logged" in told and "long [31mxxx" in told
    assert len(told) < 700 and "\033" not in told


@pytest.mark.parametrize(("what", "name"), [(guest.ROUND, "plain"), (guest.NOTHING, "flushing")])
def test_where_there_is_no_fork_the_callers_control_word_is_kept(outcome, monkeypatch, what, name):
    monkeypatch.setattr(supervision, "AVAILABLE", False)
    ended, _, neighbour, _ = outcome(what, guest.EVERYWHERE, name=name)
    assert ended.status == "completed"
    assert np.array_equal(neighbour, expected())
    assert ctypes.CDLL(None).fegetround() == 0
