"""The file of finished members: whatever becomes of it, no row is read that was not written so."""

import errno
import json
import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim.errors import ResultError
from cosim.study import running
from cosim.study.store import Store

ROWS = [
    {"key": f"k{n}", "name": f"ä-{n}", "status": "completed", "steps": n, "metrics": {"top": 1 / (n + 3), "low": None}}
    for n in range(3)
]


def written(folder):
    store = Store(folder / "members.jsonl")
    for row in ROWS:
        store.append(row)
    store.close()
    return store.path.read_bytes()


def read(folder, content):
    (folder / "members.jsonl").write_bytes(content)
    store = Store(folder / "members.jsonl")  # which is still open when it is returned
    found = {row["key"]: store[row["key"]] for row in ROWS if row["key"] in store}
    assert len(store._offsets) == len(found)
    return store, found


def test_rows_are_read_as_they_were_written(tmp_path):
    store, found = read(tmp_path, written(tmp_path))
    store.close()
    assert list(found.values()) == ROWS


def test_cut_anywhere_the_whole_rows_remain_and_what_is_added_is_kept(tmp_path):
    whole = written(tmp_path)
    ends = [k + 1 for k, byte in enumerate(whole) if byte == ord("\n")]
    for cut in range(len(whole) + 1):
        store, found = read(tmp_path, whole[:cut])
        # A line that only misses its end is whole.
        assert list(found.values()) == ROWS[: sum(cut >= end - 1 for end in ends)]
        for row in ROWS:
            if row["key"] not in store:
                store.append(row)
        store.close()
        store, found = read(tmp_path, store.path.read_bytes())
        store.close()
        assert list(found.values()) == ROWS


@settings(max_examples=300)
@given(st.data())
def test_garbled_bytes_lose_a_row_and_never_change_one(tmp_path_factory, data):
    folder = tmp_path_factory.getbasetemp() / "garbled"
    folder.mkdir(exist_ok=True)
    (folder / "members.jsonl").unlink(missing_ok=True)
    content = bytearray(written(folder))
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    store, found = read(folder, bytes(content))
    store.close()
    assert all(row in ROWS for row in found.values())


@pytest.mark.parametrize(
    "line",
    ["", "null", "[]", "7", '"text"', "{}", '{"key": "k0"}', '{"key": ["k0"], "checksum": 0}', "[" * 100_000,
     "\0" * 100, '{"key": "k0", "status": "completed"}', '{"key": "k0", "checksum": NaN}', '{"checksum": 2745614147}'],
)  # fmt: skip
def test_lines_that_are_no_rows_are_skipped(tmp_path, line):
    store, found = read(tmp_path, line.encode() + b"\n" + written(tmp_path))
    store.close()
    assert list(found.values()) == ROWS


def test_a_row_without_a_status_runs_again(results, tmp_path):
    results()
    path = tmp_path / "results" / "members.jsonl"
    lines = path.read_text().splitlines()
    row = json.loads(lines[0])
    del row["status"]
    path.write_text("\n".join([json.dumps(row), *lines[1:]]))
    again = results()
    assert (again.ran, again.reused) == (1, 23)
    assert running.summary(again)["counts"] == {"completed": 24}


@pytest.mark.parametrize("call", ["write", "fsync"])
def test_a_full_disk_names_the_file(tmp_path, monkeypatch, call):
    """Also while a line that was cut off gets its end, and while the file is closed."""
    whole = written(tmp_path)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        store = None if call == "write" else read(tmp_path, whole)[0]
        patch.setattr(os, call, full)
        said = r"cannot write .*members\.jsonl: No space left on device\n.*free some space"
        with pytest.raises(ResultError, match=said):
            read(tmp_path, whole[:-5]) if call == "write" else store.close()


def test_what_is_no_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "members.jsonl")
    with pytest.raises(ResultError, match="it is no file"):
        Store(tmp_path / "members.jsonl")


def test_a_file_that_changes_under_way_is_noticed(tmp_path):
    written(tmp_path)
    store = Store(tmp_path / "members.jsonl")
    store.path.write_bytes(store.path.read_bytes().replace(b"0.25", b"0.35"))
    with pytest.raises(ResultError, match="was changed while it was in use"):
        store["k1"]
    store.close()
