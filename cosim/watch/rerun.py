"""Orders done: a diagram read, checked, run, and told as the page needs it.

What sliders say is given to the diagram as it is wired and compiled: a tenth of the time that reading it takes.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

from cosim.authoring.leaving import left
from cosim.drawing import shapes
from cosim.drawing.svg import svg
from cosim.engine.outcome import Outcome
from cosim.engine.recording import described
from cosim.engine.run import Run
from cosim.errors import CosimError, PlotError, Position
from cosim.language.diagram import Record
from cosim.machine import importing
from cosim.plot import motion
from cosim.study.variants import Prepared, Template
from cosim.watch import block_views, check_views, loading, mistake_views, slider_views
from cosim.watch.loading import Loaded
from cosim.watch.orders import Advance, Answer, Figures, Mistaken, Order, Sketch, TrackPlace, View
from cosim.watch.spool import Spool, Track
from cosim.wiring.network import Network, Signal
from cosim.wiring.overview import describe

MOST_SAMPLES = 4000
"""Of a run whose diagram does not say what is recorded, and how often."""
PAUSE = 0.1
"""Seconds between two words on how far a run is."""


class Unwanted(Exception):
    """Nobody wants the order any more."""


class Workplace:
    """Does orders, and keeps the last diagram wired and compiled.

    tell: is told all there is to tell of an order; the last word is of `Figures` or `Mistaken`.
    """

    def __init__(self, tell: Callable[[Answer], None]) -> None:
        self._tell = tell
        self._loaded: Loaded | None = None
        self._template: Template | None = None
        self._drawing = ""
        self._blocks: dict[str, View] = {}  # as the file says
        self._compiled = 0  # kernels, since the last run
        self._of: tuple[int, tuple[str, ...]] | None = None  # the save, and what is recorded besides

    def do(self, order: Order, see_wanted: Callable[[], None]) -> None:
        """Do it. see_wanted: raises `Unwanted`, here and along the run."""
        try:
            if self._of != (order.save, order.shown):
                self._of = None
                self._load(order, see_wanted)
            if self._template:
                self._run(order, self._template, see_wanted)
        except CosimError as error:
            self._tell_mistakes(order, error.each)
        except SystemExit as leaving:
            self._tell_mistakes(order, [left(leaving)])

    def _tell_mistakes(self, order: Order, errors: list[CosimError]) -> None:
        files = self._loaded.files if self._loaded else ()
        self._tell(Mistaken(order.number, files, mistake_views.views(errors)))

    def _load(self, order: Order, see_wanted: Callable[[], None]) -> None:
        """Read, wire and compile the diagram. Raises: CosimError, Unwanted."""
        self._template = None
        self._tell(Advance(order.number, "reading"))
        self._loaded = loading.load(order)
        if self._loaded.network is None:
            self._tell_mistakes(order, self._loaded.errors)
            return
        see_wanted()
        with importing.LOADING:
            self._template = Template(_recording(self._loaded.network, order.shown))
        self._compiled = self._template.kernels.compiled
        self._drawing = svg(shapes.drawing(self._template.network))
        self._of = (order.save, order.shown)
        see_wanted()

    def _run(self, order: Order, template: Template, see_wanted: Callable[[], None]) -> None:
        places = {path: Position(f"--set {path}={value!r}") for path, value in order.sliders.items()}
        prepared = template.prepared(tuple(order.sliders.items()), places)
        run = Run(prepared.network, prepared=(prepared.program, prepared.kernels))
        run.looks = True  # as a person does at one run, not at those of a study
        self._tell(self._sketch(order, prepared))
        spool = run.samples = Spool(order.folder, described(run.network, run.simulation.probes[1]))
        stop, told = run.network.diagram.run.stop, clock.monotonic()

        def watch(time: float) -> None:
            nonlocal told
            see_wanted()
            if clock.monotonic() - told > PAUSE:
                told = clock.monotonic()
                self._tell(Advance(order.number, f"{time:.4g} of {stop:g} s", time / stop))

        outcome = run.execute(watch)
        outcome.kernels_compiled, self._compiled = self._compiled, 0
        animation = {part: str(node.value) for part, node in run.network.diagram.animation.items()}
        self._tell(_figures(order, run, outcome, spool.close(animation)))

    def _sketch(self, order: Order, prepared: Prepared) -> Sketch:
        assert self._loaded
        network = prepared.network
        overview = describe(network)
        view = {
            "title": network.diagram.title,
            "check": check_views.view(network, overview),
            "warnings": mistake_views.views(overview.warnings),
        }
        sliders: list[View] = []
        if order.sliders:
            slid = {path.split(".")[1] for path in order.sliders}
            blocks = {**self._blocks, **block_views.views(network, overview, slid)}
        else:
            sliders = slider_views.views(network)
            blocks = self._blocks = block_views.views(network, overview, network.components)
        return Sketch(order.number, self._loaded.files, view, self._drawing, blocks, sliders)


def _recording(network: Network, shown: tuple[str, ...]) -> Network:
    """The network with what the page wants to see recorded too; where nothing is recorded, what metrics look at."""
    wanted = []
    for name in shown:
        with suppress(CosimError):  # of a block that there is no more
            wanted.append(network.find(name, None))
    if not network.recorded:
        wanted += [signal.whole for signal in network.reduced.values()]
    recorded = tuple(dict.fromkeys([*network.recorded, *wanted]))
    if recorded == network.recorded:
        return network
    diagram = network.diagram
    if diagram.record is None:
        every = max(1, math.ceil(diagram.run.steps / MOST_SAMPLES))
        record = Record(every * diagram.run.step, [], diagram.blocks[recorded[0].component].position)
        diagram = replace(diagram, record=record)
    return replace(network, diagram=diagram, recorded=recorded)


def _figures(order: Order, run: Run, outcome: Outcome, track: TrackPlace) -> Figures:
    network = run.network
    return Figures(
        order.number,
        {
            "status": outcome.status,
            "time": outcome.time,
            "steps": outcome.steps,
            "seconds": outcome.seconds,
            "compiled": outcome.kernels_compiled,
            "errors": mistake_views.views([outcome.error] if outcome.error else []),
            "ended": outcome.termination.message if outcome.termination else "",
            "warnings": mistake_views.views(outcome.warnings),
            "findings": check_views.findings(outcome.conditions),
            "moving": _moves(track),
            "events": [f"{event.signal}: {event.text}" for event in outcome.events],
        },
        [str(signal) for signal in network.reduced.values()],
        outcome.metrics,
        {name: verdict.as_json() for name, verdict in outcome.requirements.items()},
        outcome.units,
        outcome.windows,
        run.reductions.meanings,
        {str(signal): _last(run, signal) for signal in network.signals()},
        track,
    )


def _moves(place: TrackPlace) -> bool:
    """Whether there are bodies to be shown moving."""
    try:
        motion.find(Track(place), motion.Motion())
    except PlotError:
        return False
    return place.count > 0


def _last(run: Run, signal: Signal) -> str:
    """A signal's value at the end."""
    per_member = run.network.components[signal.component].fleet is not None
    value = run.simulation.value(signal)
    return block_views.text_of(value if per_member else value[None], per_member=False)
