"""The index that grows at its end: HDF5 finds every chunk in it, at every size, and goes on from there itself."""

from __future__ import annotations

import h5py
import netCDF4
import numpy as np
import pytest

from cosim.results import netcdf_layout
from cosim.results.growing_file import GrowingFile
from cosim.results.growing_variable import GrowingVariable
from cosim.results.new_result import new_result
from cosim.results.recorded import Recorded

SIGNAL = Recorded("o.y", (2,), np.int16)


@pytest.fixture
def grown(monkeypatch, tmp_path):
    """A file with so many rows [k, -k] of `o.y`, two to a chunk, and its headers.

    At each of some numbers, the variables are read anew.
    """
    monkeypatch.setattr(netcdf_layout, "CHUNK_ROWS", 2)

    def make(last, *anew):
        content, headers = new_result([SIGNAL], {"created": "today"})
        path = tmp_path / f"{last}{anew}.nc"
        path.write_bytes(content)
        with path.open("r+b", buffering=0) as opened:
            file, first = GrowingFile(opened, len(content)), 0
            for count in (*anew, last):
                variables = [GrowingVariable(file, header) for header in headers]
                file.reserve(sum(variable.bytes_for(count) for variable in variables))
                for k in range(first, count):
                    for variable, values in zip(variables, (np.array([float(k)]), rows(k, k + 1)), strict=True):
                        variable.write(k, values)
                        variable.count(k + 1)
                first = count
            file.give_back()
        return path, headers

    return make


def rows(first, last):
    k = np.arange(first, last, dtype=np.int16)
    return np.stack([k, -k], axis=1)


@pytest.mark.parametrize("count", [0, 1, 2, 3, 127, 128, 129, 130, 255, 256, 257, 8191, 8192, 8193, 8321, 16385])
def test_hdf5_and_netcdf_find_all(grown, count):
    """From one node to three levels, of which the last nodes have one entry or all."""
    path, (_, header) = grown(count)
    with path.open("rb", buffering=0) as opened:
        assert GrowingVariable(GrowingFile(opened, 0), header).read(0, count) == rows(0, count).tobytes()
    with h5py.File(path) as file:
        assert np.array_equal(file["o.y"], rows(0, count)) and np.array_equal(file["time"], np.arange(count))
        assert file["o.y"].id.get_num_chunks() == -(-count // 2)
    with netCDF4.Dataset(path) as file:
        assert np.array_equal(file["o.y"][:], rows(0, count))


@pytest.mark.parametrize("anew", [(1,), (128, 129), (257, 8191, 8192, 8193, 9000)])
def test_it_is_read_and_goes_on(grown, anew):
    assert grown(9100)[0].read_bytes() == grown(9100, *anew)[0].read_bytes()


@pytest.mark.parametrize("count", [0, 1, 128, 300, 8193])
def test_hdf5_itself_goes_on(grown, count):
    """A person may add to a result, or shorten one."""
    path, _ = grown(count)
    with h5py.File(path, "r+") as file:
        for name, values in (("o.y", rows(count, count + 700)), ("time", np.arange(count, count + 700))):
            file[name].resize(count + 700, axis=0)
            file[name][count:] = values
    with h5py.File(path, "r+") as file:
        assert np.array_equal(file["o.y"], rows(0, count + 700))
        assert np.array_equal(file["time"], np.arange(count + 700))
        file["o.y"].resize(count // 2, axis=0)
    with h5py.File(path) as file:
        assert np.array_equal(file["o.y"], rows(0, count // 2))


@pytest.mark.parametrize("byte", [0, 4, 5, 6])
def test_what_is_no_index_is_refused(grown, byte):
    path, headers = grown(300)
    content = path.read_bytes()
    node = content.rindex(b"TREE") + byte
    path.write_bytes(content[:node] + b"\xee" + content[node + 1 :])
    with path.open("rb", buffering=0) as opened, pytest.raises(ValueError, match="it is damaged"):
        [GrowingVariable(GrowingFile(opened, 0), header) for header in headers]
