"""`cosim run some.fmu`: an FMU alone, from its default experiment, with every signal recorded."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

import cosim
from cosim.engine import run
from cosim.results.result_file import open_result
from cosim.terminal import cli
from tests.fmu import ball, machine, told

KINDS = {
    "2 cs": (2, "cs", ""),
    "3 events": (3, "cs", 'hasEventMode="true"'),
    "2 me": (2, "me", 'completedIntegratorStepNotNeeded="true"'),
    "3 me": (3, "me", ""),
}


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Run the command line in a folder of its own; returns exit code, standard output and error."""
    monkeypatch.chdir(tmp_path)

    def run_command(*words: object):
        capsys.readouterr()
        code = cli.main([str(word) for word in words])
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        return code, said.out, said.err

    return run_command


@pytest.mark.parametrize("engine", ["native", "python"])
@pytest.mark.parametrize("kind", KINDS)
def test_the_default_experiment_is_run_and_all_is_recorded(command, tmp_path, kind, engine):
    """From 2 s to 3 s of its own clock, in steps of 0.1 s."""
    version, kinds, flags = KINDS[kind]
    path = told.build(tmp_path, version, kinds, flags)
    code, out, err = command("run", path, "--engine", engine)
    assert code == 0, err
    assert "completed after 10 steps" in out
    assert err.count("warning:") == 1  # what the FMU itself logs
    with open_result(tmp_path / "results" / f"told{version}.nc") as result:
        assert np.array_equal(result.times, np.arange(11) * 0.1)
        recorded = {name.partition(".")[2] for name in result.signals}
        texts = {"words_told", "blob_told"} if version == 3 else set()
        names = {"tolerance", "start", "clock", "y", *told.TOLD2, *texts}
        assert recorded == names | ({"zeit", "y_too", "big_told", "total"} if version == 3 else set())
        assert {*result.read(f"told{version}.tolerance")} == {1e-5}
        assert {*result.read(f"told{version}.start")} == {2.0}
        assert result.read(f"told{version}.clock") == pytest.approx(2.0 + np.arange(11) * 0.1, rel=1e-15)
        assert result.attrs["title"] == "told, from 2 s of its own time"
        text = result.attrs["diagram"]
    (tmp_path / "again.yaml").write_text(text)  # what the file says of itself is a diagram
    assert command("run", tmp_path / "again.yaml")[0] == 0
    assert command("compare", tmp_path / "results" / f"told{version}.nc", tmp_path / "results" / "again.nc")[0] == 0


@pytest.mark.parametrize("kind", ["2 cs", "3 events"])
def test_settings_lie_over_it(command, tmp_path, kind):
    version, kinds, flags = KINDS[kind]
    path = told.build(tmp_path, version, kinds, flags)
    block = f"blocks.told{version}"
    settings = [f"{block}.parameters.k=3", f"{block}.start.u=2", "record.period=0.5", f"{block}.tolerance=0.05"]
    words = [word for setting in settings for word in ("--set", setting)]
    code, out, err = command("run", path, "--stop", 2, "--step", 0.25, "-o", "mine.nc", *words, "--json")
    assert code == 0, err
    assert json.loads(out)["steps"] == 8
    with open_result(tmp_path / "mine.nc") as result:
        assert np.array_equal(result.times, [0.0, 0.5, 1.0, 1.5, 2.0])
        assert {*result.read(f"told{version}.y")} == {6.0}
        assert {*result.read(f"told{version}.tolerance")} == {0.05}


def test_only_what_is_asked_for_is_recorded(command, tmp_path):
    path = told.build(tmp_path, 3, "cs")
    assert command("run", path, "--set", "record.signals=[told3.clock]")[0] == 0
    with open_result(tmp_path / "results" / "told3.nc") as result:
        assert [*result.signals] == ["told3.clock"]


def test_inputs_that_are_held_are_no_warning_and_stand_in_the_result(command, tmp_path):
    path = told.build(tmp_path, 3, "cs")
    _, _, err = command("run", path, "--set", "blocks.told3.start.u=5")
    assert "held:" not in err
    with open_result(tmp_path / "results" / "told3.nc") as result:
        assert "u: 5" in result.attrs["diagram"]
        assert "heat: 1" in result.attrs["diagram"]


@pytest.mark.parametrize(
    ("experiment", "words", "steps"),
    [
        ("", ("--stop", "10"), 500),
        ('<DefaultExperiment stopTime="4"/>', (), 500),
        ('<DefaultExperiment stopTime="4"/>', ("--stop", "1"), 500),
        ('<DefaultExperiment stopTime="4"/>', ("--stop", "2*pi"), 500),
        ('<DefaultExperiment stopTime="4" stepSize="0.5"/>', ("--stop", "1"), 2),
        ('<DefaultExperiment stepSize="0.5"/>', ("--stop", "1"), 2),
        ('<DefaultExperiment startTime="1" stopTime="4" stepSize="0.5"/>', (), 6),
    ],
)
def test_what_the_experiment_leaves_open_follows(command, tmp_path, experiment, words, steps):
    path = told.build(tmp_path, 3, "cs", experiment=experiment)
    code, out, err = command("run", path, *words, "--json")
    assert (code, json.loads(out)["steps"]) == (0, steps), err


def test_the_fmus_own_step_is_taken_where_it_has_one(command, tmp_path):
    path = told.build(tmp_path, 3, "cs", 'fixedInternalStepSize="0.25"', experiment='<DefaultExperiment stopTime="4"/>')
    assert json.loads(command("run", path, "--json")[1])["steps"] == 16
    assert json.loads(command("run", path, "--json", "--stop", "1e6")[1])["steps"] == 500  # else four million


@pytest.mark.parametrize(
    ("experiment", "words", "said"),
    [
        ("", (), "has no default experiment that says when it stops\n    fix: write --stop 10"),
        ('<DefaultExperiment startTime="4" stopTime="4"/>', (), "says when it stops"),
        ('<DefaultExperiment stopTime="soon"/>', (), "its stopTime cannot be `soon`"),
        ('<DefaultExperiment stopTime="inf"/>', (), "its stopTime cannot be `inf`"),
        ('<DefaultExperiment stopTime="1" stepSize="0"/>', (), "its stepSize cannot be `0`"),
        ('<DefaultExperiment stopTime="1" tolerance="-1"/>', (), "its tolerance cannot be"),
        ('<DefaultExperiment stopTime="1" stepSize="0.3"/>', (), "is not a whole number of steps of 0.3 s"),
        (told.EXPERIMENT, ("--set", "blocks.told3.parameters.kk=1"), "has no parameter `kk`"),
        (told.EXPERIMENT, ("--set", "blocks.told.parameters.k=1"), "`blocks` has no `told`"),
        (told.EXPERIMENT, ("--set", "blocks.told3.event_mode=on"), "has no event mode"),
        (told.EXPERIMENT, ("--set", "run=3"), "`run` must be a mapping"),
        (told.EXPERIMENT, ("--set", "blocks=3"), "`blocks` must be a mapping"),
        (told.EXPERIMENT, ("--set", "blocks.told3=3"), "`blocks.told3` must be a mapping"),
        (told.EXPERIMENT, ("--set", "record=3"), "`record` must be a mapping"),
        (told.EXPERIMENT, ("--set", "blocks.told3=~"), "the diagram has no `blocks`"),
        (told.EXPERIMENT, ("--set", "blocks.told3.fmu=~"), "block `told3` has no type"),
        (told.EXPERIMENT, ("--swap", "told3=Nothing"), "there is no block type `Nothing`"),
        (told.EXPERIMENT, ("--stop", "[1]"), "`run.stop` must be a number"),
    ],
)
def test_what_is_wrong_is_said_of_the_fmu(command, tmp_path, experiment, words, said):
    code, _, err = command("run", told.build(tmp_path, 3, "cs", experiment=experiment), *words)
    assert code == 2
    assert said in err
    assert err.count("error:") == 1


def test_what_is_no_fmu_is_said(command, tmp_path):
    (tmp_path / "text.fmu").write_text("text")
    (tmp_path / "folder.fmu").mkdir()
    for name, said in (("text.fmu", "no sound FMU archive"), ("gone.fmu", "cannot read"), ("folder.fmu", "folder.fmu")):
        for word in ("run", "check"):
            code, _, err = command(word, name)
            assert (code, said in err) == (2, True), (name, err)


def test_check_and_plot_go_with_it(command, tmp_path):
    pytest.importorskip("matplotlib")
    path = told.build(tmp_path, 3, "cs")
    code, out, err = command("check", path)
    assert code == 0, err
    assert "told3: 1 blocks, valid" in out or "1 blocks, valid" in out
    assert "1 s in 10 steps of 0.1 s" in out
    assert command("run", path)[0] == 0
    code, out, err = command("plot", "results/told3.nc")
    assert code == 0, err
    assert "told3.clock" in out
    assert (tmp_path / "results" / "told3.png").stat().st_size > 1000


def test_a_picture_of_many_signals_shows_the_outputs(tmp_path):
    from cosim.plot import signal_plot

    path = machine.build(tmp_path, 3, "me")
    network = run.load(path, ["run.stop=0.1", "run.step=0.01"])
    output = tmp_path / "many.nc"
    assert run.Run(network, output=output).execute().status == "completed"
    with open_result(output) as result:
        assert len(result.signals) > signal_plot.MOST_PANELS
        shown = signal_plot.default_signals(result)
        assert "machine3.x" in shown
        assert "machine3.v" not in shown


def test_model_exchange_is_integrated_by_rk4(tmp_path, trajectories):
    """x(1) of T dx/dt = u - x with T = 1: e^-1 to (1/100)^4; Euler would be 2e-3 off."""
    path = machine.build(tmp_path, 2, "me")
    network = run.load(path, ["run.stop=1", "run.step=0.01", "blocks.machine2.start.x=1"])
    assert network.diagram.run.integrator == "rk4"
    got = trajectories(network, "machine2.x")["machine2.x"].ravel()
    assert got[-1] == pytest.approx(np.exp(-1.0), abs=1e-9)


def test_file_names_that_no_block_can_have(tmp_path):
    path = told.build(tmp_path, 3, "cs")
    for name, block in (("3 tanks (1).fmu", "fmu_3_tanks__1_"), ("Größe.v2.FMU", "Größe_v2"), ("-x.fmu", "fmu_-x")):
        shutil.copy(path, tmp_path / name)
        assert [*run.load(tmp_path / name).components] == [block]


def test_a_program_may_load_one(tmp_path):
    network = cosim.load(told.build(tmp_path, 3, "cs")).network
    assert cosim.Run(network).execute().status == "completed"


@pytest.mark.parametrize("integrator", ["dormand-prince", "lsoda", "radau", "dop853"])
@pytest.mark.parametrize("version", [2, 3])
def test_a_ball_in_model_exchange_bounces_under_integrators_of_both_houses(command, tmp_path, version, integrator):
    """All but its indicator is recorded. It falls for s = sqrt(2/g), and rises with 0.7 g s."""
    path = ball.build(tmp_path, version)
    settings = "run.method=joint", "run.step=0.1", f"run.integrator={integrator}", "run.tolerance=1e-9"
    code, _, err = command("run", path, "--stop", "1", *(word for s in settings for word in ("--set", s)))
    assert code == 0, err
    with open_result(tmp_path / "results" / f"ball{version}.nc") as result:
        assert {name.partition(".")[2] for name in result.signals} >= {"h", "v", "bounces"}
        h, bounces = result.read(f"ball{version}.h"), result.read(f"ball{version}.bounces")
    fall = (2.0 / 9.81) ** 0.5
    since = 1.0 - fall
    assert bounces[-1] == 1
    assert h[4] == pytest.approx(1.0 - 0.5 * 9.81 * 0.4**2, abs=1e-7)
    assert h[-1] == pytest.approx(0.7 * 9.81 * fall * since - 0.5 * 9.81 * since**2, abs=1e-6)
