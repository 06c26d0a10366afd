"""Samples in files, which one process writes along a run and another reads: they outlive the first."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

import numpy as np

from cosim.engine.probes import Samples
from cosim.engine.recording import Kept
from cosim.errors import ResultError
from cosim.language import source
from cosim.machine.files import usual_fix
from cosim.results.recorded import Array, Recorded
from cosim.watch.orders import TrackPlace

LEFT_FREE = 500_000_000
"""Bytes of the disk that are left to others, however long a run is."""
_TIMES = "times"


class Spool(Kept):
    """Recorded samples in a folder of their own, batch by batch: a file of rows for each signal."""

    def __init__(self, folder: Path, signals: Iterable[Recorded]) -> None:
        self.signals = {recorded.name: recorded for recorded in signals}
        self._folder = folder
        self._count = 0
        folder.mkdir(parents=True)
        self._files: dict[str, IO[bytes]] = {_TIMES: (folder / _TIMES).open("wb")}
        self._files |= {name: (folder / str(k)).open("wb") for k, name in enumerate(self.signals)}

    def append(self, samples: Samples) -> None:
        """Keep a batch. Raises: ResultError where there is no room."""
        if shutil.disk_usage(self._folder).free < LEFT_FREE:
            raise ResultError("the disk is nearly full", fix="a longer `record.period`, or fewer signals")
        try:
            self._files[_TIMES].write(samples.times.tobytes())
            for signal, array in samples.values.items():
                name = str(signal)
                self._files[name].write(array.astype(self.signals[name].dtype, copy=False).tobytes())
        except OSError as error:
            message = f"cannot write samples to {self._folder}: {error.strerror}"
            raise ResultError(message, fix=usual_fix(error)) from None
        self._count += len(samples.times)

    def close(self, animation: dict[str, str]) -> TrackPlace:
        """Where they are now."""
        for file in self._files.values():
            file.close()
        return TrackPlace(self._folder, self._count, self.signals, animation)

    def flat(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """As of `Kept`; the samples stay where they are."""
        track = Track(self.close({}))
        return track.times, {name: track.read(name) for name in self.signals}


class Track:
    """The samples of a run that is over; as a `Drawable` of pictures. Nothing is read before it is looked at.

    times: (k,) in s.
    """

    def __init__(self, place: TrackPlace) -> None:
        self.path = place.folder
        self.signals = place.signals
        self.attrs: dict[str, Any] = {"diagram": source.dump({"animation": place.animation})}
        self._count = place.count
        self._number = {name: k for k, name in enumerate(place.signals)}
        self.times: Array = self._mapped(_TIMES, np.dtype(float), ())

    def read(self, name: str) -> Array:
        """All samples of a signal, (k, *shape). Raises: ResultError."""
        if name not in self._number:
            raise ResultError(f"`{name}` is not recorded")
        signal = self.signals[name]
        return self._mapped(str(self._number[name]), np.dtype(signal.dtype), signal.shape)

    def _mapped(self, file: str, dtype: np.dtype[Any], shape: tuple[int, ...]) -> Array:
        whole = (self._count, *shape)
        if 0 in whole:
            return np.zeros(whole, dtype)
        return np.memmap(self.path / file, dtype, "r", shape=whole)

    def remove(self) -> None:
        """Delete the files; whoever reads them goes on reading."""
        shutil.rmtree(self.path, ignore_errors=True)
