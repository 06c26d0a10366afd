"""The cache of object code: what is damaged, foreign or cannot be written costs time and a word, never the run."""

import errno
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from cosim.compiling.adapters import block_source
from cosim.compiling.fingerprint.text import obstacle
from cosim.engine.run import Run, load
from cosim.machine import cache
from cosim.study import running, study_file
from cosim.study.running import Options
from cosim.terminal import cli
from cosim.wiring import block_files

CODE = bytes(range(256)) * 8
POSIX = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="owners and modes are those of POSIX")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cache folder of the test's own."""
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "cache"))
    cache._say.cache_clear()
    return tmp_path / "cache"


def entries(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


def test_what_is_written_is_read(folder, caplog):
    assert cache.read("a") is None
    cache.write("a", CODE)
    assert cache.read("a") == CODE and cache.read("b") is None
    assert [e.name for e in entries(folder)] == ["a.o"]
    assert caplog.text == ""


def test_no_code_is_code_too(folder):
    cache.write("a", b"")
    assert cache.read("a") == b""


@pytest.mark.parametrize("size", [0, 1, 18, 19, 30, 83, 84, 85, 100, 1000, len(CODE), len(CODE) + 83])
def test_a_cut_entry_is_not_read(folder, caplog, size):
    cache.write("a", CODE)
    path = folder / "a.o"
    whole = path.read_bytes()
    assert size < len(whole)
    path.write_bytes(whole[:size])
    assert cache.read("a") is None
    assert f"{path} was damaged; compiled anew" in caplog.text
    path.write_bytes(whole + b"\0")
    assert cache.read("a") is None


def test_no_bit_may_change(folder):
    cache.write("a", CODE)
    path = folder / "a.o"
    whole = path.read_bytes()
    for bit in (*range(8 * 100), *range(8 * 100, 8 * len(whole), 37)):
        changed = bytearray(whole)
        changed[bit // 8] ^= 1 << bit % 8
        path.write_bytes(changed)
        assert cache.read("a") is None, bit
    path.write_bytes(whole)
    assert cache.read("a") == CODE


def test_entries_are_not_exchanged(folder):
    cache.write("a", CODE)
    cache.write("b", CODE[::-1])
    (folder / "a.o").rename(folder / "c.o")
    (folder / "b.o").rename(folder / "a.o")
    (folder / "c.o").rename(folder / "b.o")
    assert cache.read("a") is None and cache.read("b") is None


@pytest.mark.parametrize(
    "content", [b"\0" * 5000, b"\x7fELF" + b"\0" * 500, b"cosim object code 2 " + b"0" * 64 + b"\n"]
)
def test_what_is_no_entry_is_not_read(folder, content):
    cache.write("a", CODE)
    (folder / "a.o").write_bytes(content)
    assert cache.read("a") is None


@POSIX
def test_the_folder_is_the_users_alone(folder, monkeypatch):
    before = os.umask(0)
    try:
        cache.write("a", CODE)
    finally:
        os.umask(before)
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (folder / "a.o").stat().st_mode & 0o777 == 0o600


@POSIX
@pytest.mark.parametrize("mode", [0o620, 0o602, 0o666])
def test_a_file_that_others_may_write_to_is_not_read(folder, caplog, mode):
    cache.write("a", CODE)
    (folder / "a.o").chmod(mode)
    assert cache.read("a") is None
    assert "a.o can be written by others: chmod go-w; compiled anew" in caplog.text
    cache.write("a", CODE)
    assert cache.read("a") == CODE


@POSIX
@pytest.mark.parametrize("mode", [0o720, 0o702, 0o777])
def test_a_folder_that_others_may_write_to_is_not_used(folder, caplog, mode):
    cache.write("a", CODE)
    folder.chmod(mode)
    assert cache.read("a") is None
    cache.write("b", CODE)
    assert [e.name for e in entries(folder)] == ["a.o"]
    assert caplog.text.count("is not used (can be written by others: chmod go-w)") == 1


@POSIX
@pytest.mark.parametrize("whose", ["file", "folder"])
def test_what_belongs_to_another_user_is_not_read(folder, caplog, monkeypatch, whose):
    cache.write("a", CODE)
    real = {name: getattr(os, name) for name in ("stat", "fstat")}

    def foreign(status):
        values = list(status)
        values[4] = os.geteuid() + 1
        return os.stat_result(values)

    if whose == "file":
        monkeypatch.setattr(cache.os, "fstat", lambda descriptor: foreign(real["fstat"](descriptor)))
    else:
        monkeypatch.setattr(cache.os, "stat", lambda path, **more: foreign(real["stat"](path, **more)))
    assert cache.read("a") is None
    assert "belongs to another user" in caplog.text


@POSIX
def test_what_belongs_to_the_system_is_read(folder, monkeypatch):
    cache.write("a", CODE)
    monkeypatch.setattr(cache.os, "geteuid", lambda: folder.stat().st_uid + 1)
    assert (cache.read("a") == CODE) == (folder.stat().st_uid == 0)


@POSIX
@pytest.mark.parametrize("kind", ["fifo", "folder", "link"])
def test_what_is_no_file_is_not_waited_for(folder, caplog, kind):
    cache.write("b", CODE)
    path = folder / "a.o"
    {"fifo": lambda: os.mkfifo(path), "folder": path.mkdir, "link": lambda: path.symlink_to(folder / "b.o")}[kind]()
    assert cache.read("a") is None
    assert "compiled anew" in caplog.text


def test_a_full_disk_leaves_nothing_behind(folder, caplog, monkeypatch):
    cache.write("a", CODE)
    plain = os.fdopen

    class Full:
        def __init__(self, descriptor, mode):
            self.file = plain(descriptor, mode)

        def __enter__(self):
            return self

        def __exit__(self, *error):
            self.file.close()

        def write(self, data):
            self.file.write(data[:100])
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(cache.os, "fdopen", Full)
    cache.write("b", CODE)
    assert [e.name for e in entries(folder)] == ["a.o"]
    assert "cannot be written (No space left on device)" in caplog.text


def test_an_interrupted_write_leaves_what_was_there(folder, monkeypatch):
    cache.write("a", CODE)
    made = []

    def interrupted(source, target):
        made.append(Path(source).read_bytes())
        raise KeyboardInterrupt

    monkeypatch.setattr(cache.os, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        cache.write("a", CODE[::-1])
    assert made and [e.name for e in entries(folder)] == ["a.o"]
    assert cache.read("a") == CODE


def test_a_reader_sees_the_old_entry_or_the_new_one(folder):
    """Many writers and a reader: what is read is always whole."""
    cache.write("a", CODE)
    stop = threading.Event()

    def write(code):
        while not stop.is_set():
            cache.write("a", code)

    writers = [threading.Thread(target=write, args=(code,)) for code in (CODE, CODE[::-1])]
    for writer in writers:
        writer.start()
    try:
        assert {cache.read("a") for _ in range(300)} <= {CODE, CODE[::-1]}
    finally:
        stop.set()
        for writer in writers:
            writer.join()
    assert [e.name for e in entries(folder)] == ["a.o"]


PLACES = {
    "a file": (lambda path: path.write_text("text"), "cache is not used"),
    "below a file": (lambda path: path.write_text("text"), "cache/below is not used"),
    "a dead link": (lambda path: path.symlink_to(path.with_name("nowhere") / "at" / "all"), "cache"),
}


@pytest.mark.parametrize("name", PLACES)
def test_a_place_that_is_no_folder_costs_time_only(tmp_path, monkeypatch, caplog, name):
    make, words = PLACES[name]
    make(tmp_path / "cache")
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "cache" / ("below" if "below" in name else "")))
    cache._say.cache_clear()
    for _ in range(2):
        assert cache.read("a") is None
        cache.write("a", CODE)
    err = caplog.text
    assert words in err and err.count("\n") == 1


def test_no_home_costs_time_only(monkeypatch, caplog):
    for name in ("COSIM_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)

    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(cache.Path, "home", no_home)
    cache._say.cache_clear()
    assert cache.read("a") is None
    cache.write("a", CODE)
    assert caplog.text.count("there is no home: set COSIM_CACHE") == 1


def test_a_folder_that_cannot_be_written_costs_time_only(folder, caplog, monkeypatch):
    def refused(**more):
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(cache.tempfile, "mkstemp", refused)
    for name in ("a", "b"):
        cache.write(name, CODE)
        assert cache.read(name) is None
    assert caplog.text.count("cannot be written (Permission denied)") == 1


# ---- runs ----

OWN = """
import consts
from cosim import Block, Input, Output


class Scaled(Block{plain}):
    u = Input(start=1)
    y = Output()

    def outputs(u, y):
        y[0] = consts.SCALE * u
"""
DIAGRAM = (
    "run: {stop: 0.1, step: 0.1}\nblocks:\n  b: {python: 'own.py:Scaled'}\n"
    "metrics: {last: {signal: b.y, reduce: final}}\n"
)


@pytest.fixture
def author(tmp_path, monkeypatch, folder, new_cache):
    """A folder with a block that reads `consts.SCALE`, a diagram and a study of it; sets the number."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "d.yaml").write_text(DIAGRAM)
    (tmp_path / "s.yaml").write_text("diagram: d.yaml\n")

    def write(scale: float, plain: bool = False) -> None:
        (tmp_path / "own.py").write_text(OWN.format(plain=", compiled=False" if plain else ""))
        (tmp_path / "consts.py").write_text(f"SCALE = {scale}\n")

    return write


def run(*arguments: str) -> str:
    """The command line in a process of its own; what it prints."""
    done = subprocess.run(
        [sys.executable, "-m", "cosim.terminal.cli", *arguments], capture_output=True, text=True, check=True
    )
    return done.stdout + done.stderr


@pytest.mark.parametrize("plain", [False, True])
def test_a_constant_of_an_imported_module_takes_effect_at_once(author, plain):
    """The file changes within a second and keeps its size: neither the cache nor Python's own one may be old."""
    for scale in (2.0, 3.0, 2.0):
        author(scale, plain)
        assert f'"last": {scale}' in run("run", "d.yaml", "--json")


@pytest.mark.parametrize("plain", [False, True])
def test_a_study_runs_again_what_a_constant_changes(author, plain, tmp_path):
    counts = []
    for scale in (2.0, 2.0, 3.0, 3.0, 2.0):
        author(scale, plain)
        done = running.run(study_file.load("s.yaml"), Options(tmp_path / "results"))
        assert [row["metrics"]["last"] for row in done.rows()] == [scale]
        counts.append(done.ran)
    assert counts == [1, 0, 1, 0, 0]


@pytest.mark.parametrize("reads", ["consts.SCALE", "consts.TABLE[0]", "consts.helper()"])
def test_a_value_that_changes_within_a_process_takes_effect(author, reads):
    """As in a notebook; a helper of the function reads it, which other blocks may share."""
    author(2.0)
    Path("consts.py").write_text("SCALE = 2.0\nTABLE = (2.0, 0.0)\n")
    text = OWN.format(plain="").replace("consts.SCALE", "helper()")
    Path("own.py").write_text(f"{text}\n\ndef helper():\n    return {reads.replace('consts.helper()', 'inner()')}\n")
    with Path("own.py").open("a") as file:
        file.write("\n\ndef inner():\n    return consts.SCALE\n")
    for scale in (2.0, 3.0):
        consts = block_files.import_file(Path("own.py")).consts
        consts.SCALE, consts.TABLE = scale, (scale, 0.0)
        assert Run(load("d.yaml")).execute().metrics == {"last": scale}


def test_a_comment_reruns_nothing(author, tmp_path):
    author(2.0)
    first = running.run(study_file.load("s.yaml"), Options(tmp_path / "results"))
    (tmp_path / "own.py").write_text("# a comment\n\n" + OWN.format(plain=""))
    second = running.run(study_file.load("s.yaml"), Options(tmp_path / "results"))
    assert (first.ran, second.ran) == (1, 0)


def test_a_study_runs_again_what_cannot_be_followed(author, tmp_path):
    author(2.0, plain=True)
    text = OWN.format(plain=", compiled=False").replace("consts.SCALE", "float(open('gain.txt').read())")
    (tmp_path / "own.py").write_text(text)
    for gain in ("2.0", "3.0"):
        (tmp_path / "gain.txt").write_text(gain)
        done = running.run(study_file.load("s.yaml"), Options(tmp_path / "results"))
        assert [row["metrics"]["last"] for row in done.rows()] == [float(gain)]


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "zeros", "exchanged"])
def test_a_damaged_cache_costs_a_compilation(author, folder, damage):
    author(2.0)
    run("run", "d.yaml")
    whole = {entry.name: entry.read_bytes() for entry in entries(folder)}
    (block,) = (name for name in whole if name.startswith("Scaled"))
    (other,) = (name for name in whole if name != block)
    content = whole[block]
    middle = len(content) // 2
    changed = {
        "cut": content[:middle],
        "flipped": content[:middle] + bytes([content[middle] ^ 16]) + content[middle + 1 :],
        "empty": b"",
        "zeros": bytes(len(content)),
        "exchanged": whole[other],
    }[damage]
    (folder / block).write_bytes(changed)
    said = run("run", "d.yaml", "--json")
    assert '"kernels_compiled": 1' in said and '"last": 2.0' in said and said.count("was damaged; compiled anew") == 1
    assert '"kernels_compiled": 0' in run("run", "d.yaml", "--json")
    assert {entry.name: entry.read_bytes() for entry in entries(folder)} == whole


def test_what_cannot_be_followed_is_compiled_at_every_run(author, tmp_path, folder):
    author(2.0)
    text = OWN.format(plain="").replace("import consts\n", "import ctypes\n\nlib = ctypes.CDLL(None).cos\n")
    text = text.replace("consts.SCALE", "(2.0 if lib else 3.0)")
    (tmp_path / "own.py").write_text(text)
    block = block_files.import_file(tmp_path / "own.py").Scaled.declaration
    made = [block_source(block, block.functions[0], {}) for _ in range(2)]
    assert made[0].fingerprint != made[1].fingerprint
    assert obstacle(made[0].fingerprint)


def test_a_long_name_is_no_obstacle(author, tmp_path, folder):
    author(2.0)
    name = "Ä" * 300
    (tmp_path / "own.py").write_text(OWN.format(plain="").replace("Scaled", name))
    (tmp_path / "d.yaml").write_text(DIAGRAM.replace("Scaled", name))
    run("run", "d.yaml")
    assert '"kernels_compiled": 0' in run("run", "d.yaml", "--json")


def test_numbas_settings_are_part_of_the_key(monkeypatch):
    before = cache.toolchain()
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    assert cache.toolchain() != before


def test_the_command_line_says_once_that_there_is_no_cache(author, tmp_path, monkeypatch, capsys):
    author(2.0)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("COSIM_CACHE", str(tmp_path / "file"))
    cache._say.cache_clear()
    assert cli.main(["run", "d.yaml", "--json"]) == 0
    captured = capsys.readouterr()
    assert '"last": 2.0' in captured.out and captured.err.count("is not used") == 1
