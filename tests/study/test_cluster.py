"""The same study in other processes: on a Dask cluster of two workers, one of which dies."""

import os
import signal
import threading
import time

import pytest

from cosim.errors import ClusterError
from cosim.study import executors, running
from cosim.study.executors import processes
from cosim.study.running import Options
from cosim.study.variants import Variants
from tests.study.conftest import DIAGRAM, STUDY

SLOW = DIAGRAM.replace("step: 0.01", "step: 0.00001")


@pytest.fixture
def cluster():
    distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra `dask`)")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as made:
        yield made


def figures(results):
    return [(row["name"], row["status"], row["metrics"]) for row in results.rows()]


def test_a_cluster_gives_the_same_bits(results, study, cluster, tmp_path):
    here = figures(results())
    there = running.run(study(), Options(tmp_path / "there", cluster=cluster.scheduler_address))
    assert there.ran == 24
    assert figures(there) == here


def test_a_worker_that_dies_takes_nothing_with_it(results, study, cluster, tmp_path):
    text = STUDY.replace("count: 4", "count: 40")
    here = figures(results(text, SLOW))

    def kill_one():
        while sum(1 for _ in (tmp_path / "there").glob("members.jsonl")) == 0 or lines() < 20:
            time.sleep(0.01)
        os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
        killed.append(lines())

    def lines():
        return (tmp_path / "there" / "members.jsonl").read_bytes().count(b"\n")

    killed: list[int] = []
    killer = threading.Thread(target=kill_one, daemon=True)
    killer.start()
    there = running.run(study(text, SLOW), Options(tmp_path / "there", cluster=cluster.scheduler_address))
    killer.join(timeout=30)
    assert killed and killed[0] < 240  # it died before the end
    assert (there.ran, there.reused) == (240, 0)
    assert figures(there) == here


def test_blocks_that_a_process_has_once_run_in_processes(results, study, tmp_path, monkeypatch):
    here = figures(results())
    monkeypatch.setattr(Variants, "shareable", lambda self: False)
    used = []
    monkeypatch.setattr(executors, "processes", lambda n, stop: used.append(n) or processes(n, stop))
    there = running.run(study(), Options(tmp_path / "there"))
    assert used
    assert figures(there) == here


def test_no_scheduler_is_an_error_in_words(study, tmp_path):
    pytest.importorskip("distributed", reason="Dask is not installed (extra `dask`)")
    with pytest.raises(ClusterError, match="there is no Dask scheduler"):
        running.run(study(), Options(tmp_path / "there", cluster="tcp://127.0.0.1:9"))
