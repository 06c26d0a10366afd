"""The file of a result before the first sample: HDF5 makes it, in memory."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from io import BytesIO
from typing import Any

from cosim.results import attributes, netcdf_layout
from cosim.results.growing_file import GrowingFile
from cosim.results.growing_variable import GrowingVariable
from cosim.results.recorded import Recorded
from cosim.results.software_versions import versions

_INCREMENT = 64 * 1024  # by which the memory grows


def new_result(signals: Sequence[Recorded], about: Mapping[str, Any]) -> tuple[bytes, list[int]]:
    """The bytes of the file, in which each variable has an index without entries, and where headers of variables are.

    Those are time's, and then each signal's. Raises: ResultError.
    """
    import h5py

    created = datetime.now(UTC).isoformat(timespec="seconds")
    about = {"title": "", "created": created, "versions": versions(), **about}
    names = ["time", *(netcdf_layout.netcdf_name(signal.name) for signal in signals)]
    with _in_memory() as file:
        attributes.create(file, about)
        netcdf_layout.create(file, signals)
        file.flush()
        image = file.id.get_file_image()
        headers = [h5py.h5o.get_info(file[name].id).addr for name in names]
    memory = BytesIO(image)
    growing = GrowingFile(memory, len(image))
    for header in headers:
        GrowingVariable(growing, header).index.begin()
    attributes.write_first(growing, about)
    growing.give_back()
    return memory.getvalue(), headers


def _in_memory() -> Any:
    """A file of the earliest format, which has no checksums over what changes.

    Nor does it have a mark for "open for writing", which a process that is killed would leave set. Of the attributes
    no order is kept, as headers in which it is have checksums.
    """
    import h5py

    creation, access = h5py.h5p.create(h5py.h5p.FILE_CREATE), h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    creation.set_link_creation_order(h5py.h5p.CRT_ORDER_TRACKED | h5py.h5p.CRT_ORDER_INDEXED)
    access.set_libver_bounds(h5py.h5f.LIBVER_EARLIEST, h5py.h5f.LIBVER_V110)
    access.set_fapl_core(_INCREMENT, False)
    name = os.urandom(8).hex().encode()  # as HDF5 refuses a second one of a name
    return h5py.File(h5py.h5f.create(name, h5py.h5f.ACC_TRUNC, creation, access))
