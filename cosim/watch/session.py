"""A diagram that is watched: what the page shows of it, what that is compared with, and what is run next.

A save drops what sliders say: then the file counts. Its run is compared with that of the save before; a run with
sliders with that of the file as it stands.
"""

from __future__ import annotations

import shutil
import threading
import time as clock
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from cosim.watch import slider_views, state_views
from cosim.watch.orders import Advance, Answer, Died, Figures, GivenUp, Mistaken, Order, Sketch, View
from cosim.watch.runner import Runner
from cosim.watch.spool import Track
from cosim.watch.watched_files import WatchedFiles


@dataclass(frozen=True, eq=False)
class Shown:
    """A run that is shown, or was before."""

    order: Order
    figures: Figures
    track: Track


class WatchSession:
    """path: of a diagram or an FMU; settings, swaps: as of --set and --swap. folder: for samples.

    `wait` gives whoever shows it the newest state.
    """

    def __init__(self, path: Path, settings: tuple[str, ...], swaps: tuple[str, ...], folder: Path) -> None:
        self._folder = folder
        self._news = threading.Condition()
        self._version = 0
        self._order = Order(0, 0, 0.0, path, settings, swaps, {}, (), folder)  # the newest
        self._orders: dict[int, Order] = {}  # those that are not done
        self._advance: View | None = None
        self._mistakes: list[View] = []
        self._sketch: Sketch | None = None
        self._sliders: dict[str, View] = {}  # of the file as it stands
        self._slid = 0  # the order that they are of
        self._now: Shown | None = None
        self._saved: Shown | None = None  # of the file as it stands
        self._before: Shown | None = None  # of the save before
        self._files: tuple[Path, ...] = (path.absolute(),)
        self._runner = Runner(self._hear)
        self._watched = WatchedFiles(self.save)

    def start(self) -> None:
        """Run the diagram for the first time, and whenever a file changes."""
        self._watched.look_at(self._files, clock.time())
        self.save()

    def close(self) -> None:
        """End what goes on."""
        self._watched.stop()
        self._runner.close()

    # ---- what is wanted ----

    def save(self) -> None:
        """The files have changed."""
        with self._news:
            self._submit(self._order.save + 1, {}, self._order.shown)

    def slide(self, values: Mapping[str, float]) -> None:
        """All that sliders say. Paths that no slider has are left out."""
        with self._news:
            known = {path: value for path, value in values.items() if path in self._sliders}
            typed = {p: round(v) if self._sliders[p]["integer"] else float(v) for p, v in known.items()}
            if typed != self._order.sliders:
                self._submit(self._order.save, typed, self._order.shown)

    def show(self, signal: str) -> None:
        """Record this signal too."""
        with self._news:
            if signal not in self._order.shown:
                self._submit(self._order.save, self._order.sliders, (*self._order.shown, signal))

    def _submit(self, save: int, sliders: Mapping[str, float], shown: tuple[str, ...]) -> None:
        last, number = self._order, self._order.number + 1
        self._order = Order(
            number,
            save,
            clock.time(),
            last.path,
            last.settings,
            last.swaps,
            dict(sliders),
            shown,
            self._folder / str(number),
        )
        self._orders[number] = self._order
        self._advance = {"text": "", "part": None}
        self._runner.submit(self._order, urgent=save != last.save)

    # ---- what the runner says ----

    def _hear(self, answer: Answer) -> None:
        with self._news:
            order = self._orders.get(answer.number)
            if order is None:  # a word that came late
                return
            if order.save == self._order.save:  # else the files have changed since
                self._take(answer, order)
            elif isinstance(answer, Figures):
                Track(answer.track).remove()
            if isinstance(answer, Mistaken | Figures | GivenUp | Died):
                self._orders = {number: one for number, one in self._orders.items() if number > answer.number}
                self._advance = self._advance if self._orders else None
                if not isinstance(answer, Figures):
                    shutil.rmtree(order.folder, ignore_errors=True)
            if not (isinstance(answer, Sketch) and order.sliders):  # whose figures come at once
                self._tell()

    def _take(self, answer: Answer, order: Order) -> None:
        if isinstance(answer, Advance):
            self._advance = {"text": answer.text, "part": answer.part}
        elif isinstance(answer, Sketch):
            self._sketch, self._mistakes = answer, []
            if not order.sliders:
                self._slid, self._sliders = order.number, {view["path"]: view for view in answer.sliders}
            self._look_at(answer.files, order)
        elif isinstance(answer, Figures):
            self._end(Shown(order, answer, Track(answer.track)))
        elif isinstance(answer, Mistaken):
            self._mistakes = answer.mistakes
            self._look_at((*self._files, *answer.files), order)
        elif isinstance(answer, Died):
            self._mistakes = [state_views.death(answer)]

    def _look_at(self, files: tuple[Path, ...], order: Order) -> None:
        self._files = tuple(dict.fromkeys(files))
        self._watched.look_at(self._files, order.began)

    def _end(self, new: Shown) -> None:
        known = {self._now, self._saved, self._before}
        self._now = new
        if not new.order.sliders:
            if self._saved and self._saved.order.save != new.order.save and self._saved.figures.completed:
                self._before = self._saved
            self._saved = new
        for old in known - {None, self._now, self._saved, self._before}:
            assert old
            old.track.remove()

    # ---- what is shown ----

    def _tell(self) -> None:
        self._version += 1
        self._news.notify_all()

    def wait(self, version: int, patience: float) -> tuple[int, View | None]:
        """The state's version, and the state where that is newer than a version, within a time (s)."""
        with self._news:
            self._news.wait_for(lambda: self._version > version, patience)
            return self._version, self._state() if self._version > version else None

    @property
    def _reference(self) -> Shown | None:
        """What the run that is shown is compared with."""
        return self._saved if self._now and self._now.order.sliders else self._before

    def _state(self) -> View:
        now, before = self._now, self._reference
        view = state_views.state(self._sketch, now.figures if now else None, before.figures if before else None)
        chosen = slider_views.lines(self._sliders, self._order.sliders)
        about = {"path": str(self._order.path), "advance": self._advance, "slid": self._slid}
        return {**view, **about, "mistakes": self._mistakes, "chosen": chosen}

    @property
    def drawing(self) -> str:
        """The diagram's, as SVG; "" where there is none yet."""
        with self._news:
            return self._sketch.drawing if self._sketch else ""

    @property
    def sliders(self) -> list[View]:
        """Of the file as it stands."""
        with self._news:
            return [*self._sliders.values()]

    def block(self, name: str) -> View | None:
        """A block, with the values of its signals at the end of the run that is shown."""
        with self._news:
            return state_views.block(self._sketch, self._now.figures if self._now else None, name)

    def track(self, number: int) -> Track | None:
        """The samples of a run that is shown."""
        with self._news:
            several = (self._now, self._saved, self._before)
            return next((one.track for one in several if one and one.figures.number == number), None)
