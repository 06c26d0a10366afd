"""The file of a checkpoint: what was written comes back to the bit, or nothing does."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from cosim.errors import CheckpointError, ResultError
from cosim.results import metrics
from cosim.results.checkpoint_file import CheckpointFile, decoded, encoded

KINDS = ["<f8", "<f4", "<i8", "<i4", "<i2", "|i1", "|u1", "<u4", "<u8", "|b1"]
ARRAYS = st.sampled_from(KINDS).flatmap(
    lambda kind: arrays.arrays(np.dtype(kind), arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4))
)
TREES = st.recursive(ARRAYS, lambda below: st.lists(below, max_size=3) | st.dictionaries(st.text(), below, max_size=3))
JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**60), 2**60)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda below: st.lists(below, max_size=3) | st.dictionaries(st.text(), below, max_size=3),
)


def same(one, other) -> bool:
    if isinstance(one, dict):
        return list(one) == list(other) and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(same, one, other))
    return one.dtype == other.dtype and one.shape == other.shape and one.tobytes() == other.tobytes()


def content(about, tree) -> bytes:
    return b"".join(bytes(piece) for piece in encoded(about, tree))


@given(st.dictionaries(st.text(), JSON, max_size=3), TREES)
def test_what_was_written_comes_back_to_the_bit(about, tree):
    said, known = decoded(content(about, tree))
    assert said == about and same(known, tree)


@given(TREES, st.data())
def test_one_byte_that_is_another_is_found(tree, data):
    whole = content({"time": 1.5}, tree)
    at = data.draw(st.integers(0, len(whole) - 1))
    changed = whole[:at] + bytes([whole[at] ^ data.draw(st.integers(1, 255))]) + whole[at + 1 :]
    for damaged in (changed, whole[:at], whole + whole[at:]):
        with pytest.raises(ValueError, match=r"^"):
            decoded(damaged)


@pytest.mark.parametrize(
    "outline", ["O8 3", "f8 99999999", "f8 -1", "f3", "f8 3 x", "V8", "<f8 1", "f8 999999999999999 9"]
)
def test_what_a_forged_header_asks_for_is_not_given(outline, tmp_path):
    """With a digest that fits: no objects, no more than the file has."""
    whole = content({"a": 1}, {"x": np.zeros(3)}).replace(b'"f8 3"', f'"{outline}"'.encode())
    import hashlib

    length = whole.index(b"}}") + 2 - 48
    body = length.to_bytes(8, "little") + whole[48:]
    forged = whole[:8] + hashlib.sha256(body).digest() + body
    with pytest.raises((ValueError, TypeError)):
        decoded(forged)
    (tmp_path / "a.checkpoint").write_bytes(forged)
    with pytest.raises(CheckpointError, match="is damaged"):
        CheckpointFile(tmp_path / "a.checkpoint").take()


def test_at_every_instant_there_is_a_whole_one(tmp_path, monkeypatch):
    """Whichever call on the file system is the last: the one before, or the new one."""
    path = tmp_path / "run.checkpoint"
    changing = ("replace", "unlink", "fsync", "open")
    for last in range(6):
        CheckpointFile(path).write({"number": 1}, [])
        left = [last]

        def cut(do, left=left):
            def call(*arguments, **options):
                if not left[0]:
                    raise SystemExit
                left[0] -= 1
                return do(*arguments, **options)

            return call

        with monkeypatch.context() as patch:
            for name in changing:
                patch.setattr(os, name, cut(getattr(os, name)))
            patch.setattr(Path, "unlink", lambda self, missing_ok=False: os.unlink(self))  # noqa: PTH108
            with suppress(SystemExit, FileNotFoundError):
                CheckpointFile(path).write({"number": 2}, [np.zeros(100)])
        assert decoded(path.read_bytes())[0]["number"] in (1, 2)


def test_what_a_kill_left_is_cleared_away_with_the_checkpoint(tmp_path):
    path = tmp_path / "run[1].checkpoint"
    CheckpointFile(path).write({}, [])
    (tmp_path / ".run[1].checkpoint.0a1b2c3d").write_text("half")
    (tmp_path / ".run[1].checkpoint.notours").write_text("mine")
    CheckpointFile(path).remove()
    assert [other.name for other in tmp_path.iterdir()] == [".run[1].checkpoint.notours"]


HOLDING = """
import sys, time
from pathlib import Path
from cosim.results.checkpoint_file import CheckpointFile
file = CheckpointFile(Path(sys.argv[1]))
file.write({}, [])
print("written", flush=True)
time.sleep(600)
"""


def test_a_checkpoint_is_its_runs_until_that_ends(tmp_path, monkeypatch):
    monkeypatch.setattr("cosim.results.checkpoint_file.GRACE", 0.05)
    path = tmp_path / "run.checkpoint"
    with subprocess.Popen([sys.executable, "-c", HOLDING, path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "written\n"
        with pytest.raises(CheckpointError, match="is still going on"):
            CheckpointFile(path).take()
        process.kill()
    one = CheckpointFile(path)
    assert one.take() == ({}, [])
    with pytest.raises(CheckpointError, match="is still going on"):
        CheckpointFile(path).take()
    one.write({"newer": True}, [])  # which is another file, and ours as well
    with pytest.raises(CheckpointError, match="is still going on"):
        CheckpointFile(path).take()
    one.release()
    assert CheckpointFile(path).take()[0] == {"newer": True}


def test_what_cannot_be_read_is_an_error(tmp_path):
    with pytest.raises(CheckpointError, match=r"cannot read .*: No such file"):
        CheckpointFile(tmp_path / "none.checkpoint").take()
    (tmp_path / "folder.checkpoint").mkdir()
    with pytest.raises(ResultError, match="is not a checkpoint of a run"):
        CheckpointFile(tmp_path / "folder.checkpoint")
    os.mkfifo(tmp_path / "pipe.checkpoint")
    with pytest.raises(ResultError, match="is not a checkpoint of a run"):
        CheckpointFile(tmp_path / "pipe.checkpoint")


# ---- reductions ----

NUMBERS = {
    "<f8": st.floats(width=64),
    "<f4": st.floats(width=32),
    "<i8": st.integers(-(2**63), 2**63 - 1),
    "|b1": st.booleans(),
}
FITTING = {"max": KINDS, "min": KINDS, "mean": KINDS, "rms": KINDS, "final": KINDS, "first": ["|b1"]}


@pytest.mark.parametrize("name", FITTING)
@given(data=st.data())
def test_a_reduction_goes_on_from_its_state_to_the_same_bits(name, data):
    """With infinities, NaN, numbers of every size, and windows that the samples reach later, or not at all."""
    kind = data.draw(st.sampled_from([kind for kind in NUMBERS if kind in FITTING[name]]))
    rows = data.draw(st.lists(st.tuples(NUMBERS[kind], NUMBERS[kind]), min_size=1, max_size=8))
    samples, times = np.array(rows, kind), np.arange(len(rows)) * 0.1
    start, cut = data.draw(st.sampled_from([None, 0.15, 5.0])), data.draw(st.integers(0, len(rows)))

    def fresh():
        return metrics.reduction(name, start, None, samples.dtype, (2,))

    whole, first, second = fresh(), fresh(), fresh()
    whole.update(times, samples)
    first.update(times[:cut], samples[:cut])
    second.restore(decoded(content({}, first.state()))[1])
    second.update(times[cut:], samples[cut:])
    assert repr(second.value()) == repr(whole.value())
    assert same(second.state(), whole.state()) or name in ("max", "min")  # of 0.0 and -0.0, whichever came first
