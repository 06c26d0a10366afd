"""FMUs in checkpoints: their state, and all that the adapter knows of them, so that resumed runs have the same bits."""

from __future__ import annotations

import os
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest

from cosim.engine import run
from cosim.engine.run import Run
from cosim.errors import CheckpointError, CosimError, DiagramErrors
from cosim.export.exporter import export_fmu
from cosim.machine import supervision
from tests.fmu import machine, stair
from tests.fmu.conftest import EVENTFUL
from tests.fmu.machine import SAVES
from tests.fmu.test_events import STAIR
from tests.fmu.test_isolation import FLEET
from tests.fmu.test_swaps_in_rings import BLOCKS, FIXED, RING
from tests.interrupted import assert_same, assert_same_results, executed, killed

pytestmark = pytest.mark.skipif(
    not supervision.AVAILABLE or shutil.which("gcc") is None, reason="needs fork and a C compiler"
)
KINDS = {"2": (2, "me cs", ""), "3": (3, "me cs", ""), "3e": (3, "cs", EVENTFUL)}
EVERY = [("2", "co-simulation"), ("3", "co-simulation"), ("3e", "co-simulation")]
EVERY += [("2", "model-exchange"), ("3", "model-exchange")]
NOT_RESTORED = (
    "SOUND",
    "TAKES_NOTHING",
    "CANNOT_WRITE",
    "CANNOT_READ",
    "SAYS_TOO_MUCH",
    "FORGETS_ITS_INPUT",
    "CRASHES",
)


@pytest.fixture(scope="session")
def saving(tmp_path_factory):
    """The test FMUs that can save their state, made once; mode: whether that of the state machine is part of it."""
    folder = tmp_path_factory.mktemp("saving")

    def of(kind: str, mode: bool = True, broken: str = "SOUND", states: int | None = None) -> Path:
        version, kinds, flags = KINDS[kind]
        options = f"-DSAVES={1 if mode else 2}", f"-DBROKEN={NOT_RESTORED.index(broken)}"
        name = folder / f"{kind}{mode}{broken}{states}"
        made = next(name.glob("*.fmu"), None)
        if made is None and states is None:
            made = machine.build(name, version, kinds, f"{SAVES[version]} {flags}", options=options)
        elif made is None:
            made = stair.build(name, version, states, flags=SAVES[version], options=options)
        return made

    return of


@pytest.fixture
def fleet(partners):
    """Wire three machines that bounce, tick, lag and count."""

    def wire(path: Path, mode: str, method: str = "jacobi", more: str = "", **settings):
        text = FLEET.format(fmu=path, mode=mode, method=method, more=more)
        record = "record={signals: [plant.x, plant.y, plant.h, plant.v, plant.bounces, plant.ticks, plant.m, lag.x]}"
        metrics = "metrics={m: {signal: plant.h, reduce: mean}, b: {signal: plant.bounces, reduce: final}}"
        others = [f"blocks.plant.{key}={value}" for key, value in settings.items()]
        return run.load(partners(text), [record, metrics, *others])

    return wire


def check(network, tmp_path, times, every="0.1", **options):
    """Killed at these times and resumed, a run has the bits of one that was not, and that took no checkpoint."""
    whole = executed(network, tmp_path / "whole.nc", **options)
    assert whole[1].status in ("completed", "terminated")
    output = tmp_path / "run.nc"
    for k, at in enumerate(times):
        killed(network, output, at, every=every, resume=k > 0, **options)
    resumed = executed(network, output, resume=True, **options)
    assert_same(whole, resumed)
    assert not (tmp_path / "run.checkpoint").exists()
    return resumed[1]


@pytest.mark.parametrize("isolated", [False, True])
@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_fleets_of_every_kind_go_on_with_the_same_bits(saving, fleet, tmp_path, kind, mode, isolated):
    network = fleet(saving(kind), mode, isolate=str(isolated).lower())
    outcome = check(network, tmp_path, (0.23, 0.61))
    assert outcome.resumed == pytest.approx(0.6) and min(outcome.metrics["b"]) >= 1


@pytest.mark.parametrize(("kind", "mode"), EVERY)
def test_an_fmu_may_leave_its_mode_out_of_its_state(saving, fleet, tmp_path, kind, mode):
    """The standard does not say; a new instance is brought there before."""
    check(fleet(saving(kind, mode=False), mode), tmp_path, (0.0, 0.31))


@pytest.mark.parametrize("method", ["gauss-seidel", "joint"])
def test_under_every_method(saving, fleet, tmp_path, method):
    check(fleet(saving("3"), "model-exchange", method), tmp_path, (0.5,))


@pytest.mark.parametrize(("kind", "mode"), [("3e", "co-simulation"), ("2", "model-exchange")])
def test_with_the_interpreted_engine(saving, fleet, tmp_path, kind, mode):
    check(fleet(saving(kind), mode), tmp_path, (0.5,), engine="python")


def test_one_instance_a_process(partners, fleet, tmp_path):
    flags = f'canBeInstantiatedOnlyOncePerProcess="true" {SAVES[2]}'
    path = machine.build(tmp_path / "single", 2, "cs", flags, options=("-DSAVES",))
    check(fleet(path, "co-simulation", isolate="true"), tmp_path, (0.4,))


@pytest.mark.parametrize(
    ("states", "method", "integrator"),
    [(0, "jacobi", "euler"), (1, "jacobi", "euler"), (2, "gauss-seidel", "rk4"), (2, "joint", "rk4")],
)
def test_time_events_between_communication_points(saving, write, tmp_path, states, method, integrator):
    """Steps of 0.3 s over events every 1 and 0.7 s: at a checkpoint, a step across an event may be half taken back."""
    text = STAIR.format(
        stop=6, step=0.3, method=method, integrator=integrator, inner=1, jump=0.5, mode="model-exchange",
        last=1 << 30, fmu=saving("3", states=states),
    )  # fmt: skip
    record = "record={signals: [plant.counter, plant.held" + (", plant.x]}" if states else "]}")
    check(run.load(write(text), [record]), tmp_path, (0.9, 5.1), every="0.3")


@pytest.mark.parametrize(("kind", "mode"), [("2", "co-simulation"), ("3", "model-exchange")])
def test_the_end_that_an_fmu_asks_for(saving, write, tmp_path, kind, mode):
    text = STAIR.format(
        stop=6, step=0.1, method="jacobi", integrator="euler", inner=1, jump=0, mode=mode, last=4,
        fmu=saving(kind, states=1),
    )  # fmt: skip
    outcome = check(run.load(write(text), ["record={signals: [plant.x]}"]), tmp_path, (1.3,))
    assert outcome.status == "completed" and "ended the simulation at t = 2.1 s" in str(outcome.termination)


def test_warnings_are_counted_over_all_parts_of_a_run(saving, fleet, tmp_path):
    more, log = "fault: 7, fault_time: [0.1, 0.2, 0.3]", tmp_path / "plant.log"
    network = fleet(saving("2"), "co-simulation", more=more, log="all", log_file=log)
    outcome = check(network, tmp_path, (0.15, 0.5))
    (warning,) = [str(w) for w in outcome.warnings if "returned a warning" in str(w)]
    count = 91 + 81 + 71  # steps of 10 ms that end from the time of the fault on, to 1 s
    assert f"{count} calls returned a warning, first at t = 0.09 s; {count} warnings logged" in warning
    assert "it says first: just a warning at 0.1" in warning
    said = log.read_text()  # by the last part of the run
    assert "just a warning at 1" in said and "just a warning at 0.3" not in said


# ---- our own ----


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """Blocks of a ring as FMUs, made once; all sampled ones, one with a continuous state, several as one."""
    folder = tmp_path_factory.mktemp("exported")
    network = ring(folder, "jacobi")

    def of(block: str, version: str) -> Path:
        path = folder / f"{block}{version[0]}.fmu"
        return path if path.exists() else export_fmu(network, [block], path, version)

    return of


def ring(folder, method, swaps=(), settings=()):
    path = folder / "ring.yaml"
    text = RING.replace("RUN", "").replace("LEAK", "").replace("METHOD", method)
    path.write_text(text.replace("type: ", f"python: {BLOCKS}:"))
    names = "leak.x, leak.y, chain.x, sum.y, gain.y, hold.z, filter.y, mixed.x"
    dropped = [
        f"blocks.{n}.drop={FIXED[n] if n != 'leak' else '[]'}"
        for n in (s.partition("=")[0] for s in swaps)
        if n in FIXED
    ]
    return run.load(path, [f"record={{signals: [{names}]}}", *dropped, *settings], swaps)


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("mode", ["co-simulation", "model-exchange"])
@pytest.mark.parametrize("isolated", ["false", "true"])
def test_our_own_fmus_go_on_with_the_same_bits(exported, tmp_path, version, mode, isolated):
    """Sampled ones with their own clocks, and one with a continuous state, in a ring of native blocks."""
    blocks = ("leak", "hold", "filter", "mixed") if version == "3.0" or mode == "model-exchange" else ("hold", "mixed")
    swaps = [f"{block}={exported(block, version)}" for block in blocks]
    settings = [
        f"blocks.{block}.{key}={value}" for block in blocks for key, value in (("mode", mode), ("isolate", isolated))
    ]
    check(ring(tmp_path, "jacobi", swaps, settings), tmp_path, (0.25, 0.7, 1.6), every="0.25")


# ---- what is refused, and what fails ----


def test_an_fmu_that_cannot_be_saved_is_refused_before_the_run(machines, fleet, tmp_path):
    network = fleet(machines["2"], "co-simulation")
    with pytest.raises(CheckpointError) as caught:
        executed(network, tmp_path / "run.nc", every="1")
    assert caught.value.message == (
        "block plant: `machine2.fmu` cannot save its state as co-simulation, as canSerializeFMUstate is not true"
    )
    assert caught.value.fix == "run it without checkpoints, or swap the block" and caught.value.position.line == 8
    assert not (tmp_path / "run.nc").exists() and Run(network).execute().status == "completed"


def test_the_mode_that_can_be_saved_is_named(fleet, tmp_path):
    def edit(xml):
        return xml.replace("<ModelExchange", f"<ModelExchange {SAVES[3]}")

    path = machine.build(tmp_path / "half", 3, edit=edit, options=("-DSAVES",))
    with pytest.raises(CheckpointError, match="canSerializeFMUState is not true") as caught:
        executed(fleet(path, "co-simulation"), tmp_path / "run.nc", every="1")
    assert caught.value.fix == "run it without checkpoints, or write `mode: model-exchange`"
    check(fleet(path, "model-exchange"), tmp_path, (0.5,))


def test_all_that_cannot_be_saved_are_told_at_once(machines, write, tmp_path):
    text = f"run: {{stop: 1, step: 0.1}}\nblocks:\n  a: {{fmu: {machines['2']}}}\n  b: {{fmu: {machines['3']}}}\n"
    with pytest.raises(DiagramErrors) as caught:
        executed(run.load(write(text)), tmp_path / "run.nc", every="1")
    assert [error.position.line for error in caught.value.errors] == [3, 4]


@pytest.mark.parametrize("isolated", ["false", "true"])
@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ("CANNOT_WRITE", r"failed at t = 0 s: fmi2SerializeFMUstate\(\) returned `error`"),
        ("CANNOT_READ", "has no function fmi2DeSerializeFMUstate"),
        ("SAYS_TOO_MUCH", "its state has 1152921504606846976 bytes, it says"),
    ],
)
def test_an_fmu_that_cannot_do_what_it_claims_ends_the_run_at_its_begin(
    saving, fleet, tmp_path, broken, words, isolated
):
    network = fleet(saving("2", broken=broken), "co-simulation", isolate=isolated)
    outcome = executed(network, tmp_path / "run.nc", every="0.5")[1]
    assert outcome.status == "failed" and outcome.steps == 0
    with pytest.raises(CosimError, match=words):
        raise outcome.error
    assert not list(tmp_path.glob("*.checkpoint"))


@pytest.mark.parametrize(
    ("broken", "words"),
    [
        ("TAKES_NOTHING", r"robot 1\) failed at t = 0.5 s: it has not taken its saved state: `x` is \[1.0\], not \[0"),
        ("FORGETS_ITS_INPUT", r"it has not taken its saved state: `y` is "),
        ("CRASHES", r"segmentation fault in fmi2SetFMUstate\(\)"),
    ],
)
def test_an_fmu_that_does_not_take_its_state_never_goes_on_as_if_it_had(saving, fleet, tmp_path, broken, words):
    network = fleet(saving("2", broken=broken), "co-simulation")
    killed(network, tmp_path / "run.nc", 0.7, every="0.5")
    content = (tmp_path / "run.checkpoint").read_bytes()
    outcome = executed(network, tmp_path / "run.nc", resume=True)[1]
    assert outcome.status == "failed"
    with pytest.raises(CosimError, match=words):
        raise outcome.error
    assert (tmp_path / "run.checkpoint").read_bytes() == content  # it may be mended


@pytest.mark.parametrize("isolated", ["false", "true"])
def test_what_kills_the_process_of_an_fmu_costs_no_more_than_the_last_steps(saving, fleet, tmp_path, isolated):
    """Such as a lack of memory; the run fails, and goes on from its checkpoint when it is asked to."""
    network = fleet(saving("3"), "co-simulation", isolate=isolated)
    whole = executed(network, tmp_path / "whole.nc")

    def watch(time: float) -> None:
        if 0.55 <= time < 0.9:
            for process in children():
                os.kill(process, signal.SIGKILL)

    _, outcome = executed(network, tmp_path / "run.nc", every="0.1", watch=watch)
    assert outcome.status == "failed" and outcome.checkpoint[1] == pytest.approx(0.5)
    assert "killed the process" in outcome.error.message
    assert_same(whole, executed(network, tmp_path / "run.nc", resume=True))


def children() -> list[int]:
    tasks = Path(f"/proc/{os.getpid()}/task").glob("*/children")
    return [int(word) for task in tasks for word in task.read_text().split()]


def test_another_fmu_of_the_same_name_is_refused(saving, fleet, tmp_path):
    path = tmp_path / "plant.fmu"
    shutil.copy(saving("2"), path)
    killed(fleet(path, "co-simulation"), tmp_path / "run.nc", 0.7, every="0.5")
    shutil.copy(saving("2", broken="TAKES_NOTHING"), path)
    with pytest.raises(CheckpointError, match="is of another run: the code of block plant is another"):
        executed(fleet(path, "co-simulation"), tmp_path / "run.nc", resume=True)


def test_no_process_is_left_and_an_interrupted_run_goes_on(saving, fleet, tmp_path):
    def watch(time: float) -> None:
        if time >= 0.5:
            raise KeyboardInterrupt

    network = fleet(saving("3"), "co-simulation", isolate="true")
    outcome = executed(network, tmp_path / "run.nc", every="0.2", watch=watch)[1]
    assert outcome.status == "interrupted" and outcome.checkpoint[1] == pytest.approx(0.4)
    executed(network, tmp_path / "run.nc", resume=True)
    executed(network, tmp_path / "whole.nc")
    assert_same_results(tmp_path / "run.nc", tmp_path / "whole.nc")
    assert np.all(np.isfinite(outcome.metrics["m"]))
