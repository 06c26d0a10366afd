"""Files are seen to change by what they hold, however an editor writes them."""

import os
import time

import pytest

from cosim.watch import watched_files
from cosim.watch.watched_files import WatchedFiles
from tests.watch.conftest import until


@pytest.fixture
def watched(tmp_path):
    """Watch a file: the changes that were seen, and the file."""
    path, seen = tmp_path / "a.yaml", []
    path.write_text("one")
    files = WatchedFiles(lambda: seen.append(path.read_text() if path.exists() else None))
    files.look_at([path], time.time() + 10)
    yield files, path, seen
    files.stop()


def test_another_content_is_a_change_and_another_time_is_none(watched):
    _, path, seen = watched
    os.utime(path, (1e9, 1e9))
    time.sleep(0.2)
    assert seen == []
    path.write_text("two")
    until(lambda: seen == ["two"])


def test_a_file_of_the_same_size_and_time_that_took_its_place_is_seen(watched):
    _, path, seen = watched
    stamp = path.stat()
    other = path.with_name("b")
    other.write_text("two")
    os.utime(other, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    other.replace(path)
    until(lambda: seen == ["two"])


def test_a_file_that_goes_and_comes_is_no_change_unless_it_stays_away(watched, monkeypatch):
    _, path, seen = watched
    monkeypatch.setattr(watched_files, "GONE", 1e9)
    path.unlink()
    time.sleep(0.2)
    path.write_text("")
    time.sleep(0.2)
    path.write_text("one")
    time.sleep(0.2)
    assert seen == []
    monkeypatch.setattr(watched_files, "GONE", 0.3)
    path.unlink()
    until(lambda: seen == [None])
    path.write_text("one")
    until(lambda: seen == [None, "one"])


def test_what_was_written_before_it_was_looked_at_is_seen(watched, tmp_path):
    files, path, seen = watched
    other = tmp_path / "c.yaml"
    began = time.time() - 1.0
    other.write_text("written while the diagram was read")
    files.look_at([path, other], began)
    assert seen == ["one"]
    files.look_at([path, other], began)  # which is looked at now
    assert seen == ["one"]


def test_what_is_not_looked_at_any_more_changes_nothing(watched, tmp_path):
    files, path, seen = watched
    files.look_at([tmp_path / "none"], time.time() + 10)
    path.write_text("two")
    time.sleep(0.2)
    assert seen == []
