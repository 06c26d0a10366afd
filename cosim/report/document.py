"""Assembles a report: sections of studies, each with tables, words, pictures, and what it was computed from."""

from __future__ import annotations

import base64
import platform
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from html import escape
from importlib import resources
from pathlib import Path
from string import Template

import numpy as np

from cosim.drawing import marks, shapes, svg
from cosim.errors import PlotError, ResultError
from cosim.machine import files
from cosim.machine.parallel import processors
from cosim.plot import animation, distribution, player
from cosim.plot import motion as motions
from cosim.plot.figures import Figure
from cosim.report import found_section, words
from cosim.results.result_file import open_result
from cosim.results.software_versions import versions
from cosim.results.text_table import TextTable
from cosim.study import file_names, found, kept, known, row_figures, running, text_tables
from cosim.study.definition import Study
from cosim.study.member_run import Row
from cosim.study.row_figures import scalar
from cosim.study.running import Results

HEAD_BYTES = 4096  # of a page, in which it says what made it


@dataclass(frozen=True)
class Pictures:
    """Figures as files beside the page. formats: of each. folder: where; None for that of its study's results.

    apart: whether each study has a folder of its own in it.
    """

    formats: tuple[str, ...] = ()
    folder: Path | None = None
    apart: bool = False

    def files(self, results: Results, figure: Figure) -> list[Path]:
        """The files of one figure; of one that moves, a film."""
        kinds = (animation.film(),) if figure.motion and self.formats else self.formats
        stem = file_names.stem(figure.name)
        kept = results.kept_in
        folder = self.folder / (kept.name if self.apart else "") if self.folder else kept
        return [folder / f"{stem}.{kind}" for kind in kinds]


def write(path: Path, studies: Sequence[Results], pictures: Pictures = Pictures()) -> list[Path]:
    """Write the report of some studies that have been run, in the place of an older one; returns the figures' files.

    Raises: ResultError, PlotError.
    """
    title = studies[0].study.title if len(studies) == 1 else "Report"
    sections = [_section(results, pictures) for results in studies]
    moving = any(figure.motion for results in studies for figure in results.study.figures)
    links = [f'<a href="#{_anchor(results)}">{escape(results.study.title)}</a>' for results in studies]
    page = Template(resources.files("cosim.report").joinpath("template.html").read_text(encoding="utf-8"))
    text = page.substitute(
        title=escape(title),
        facts=escape(_facts()),
        contents="".join(links) if len(links) > 1 else "",
        sections="\n".join([*sections, player.script()] if moving else sections),
    )
    refuse_foreign(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with files.fresh(path) as new:
            new.write_text(text, encoding="utf-8", errors="backslashreplace")
    except OSError as error:
        raise ResultError(f"cannot write {path}: {error.strerror}", fix=files.usual_fix(error)) from None
    return [file for results in studies for figure in results.study.figures for file in pictures.files(results, figure)]


def refuse_foreign(path: Path) -> None:
    """Raises: ResultError where something stands that `write` did not write."""
    files.refuse_foreign(path, "a report of this program", _is_ours)


def _is_ours(path: Path) -> bool:
    with path.open("rb") as file:
        return b'<meta name="generator" content="cosim">' in file.read(HEAD_BYTES)


def _facts() -> str:
    what = ", ".join(f"{name} {version}" for name, version in versions().items())
    return f"{datetime.now().astimezone():%Y-%m-%d %H:%M}; {what}; {processors()} × {platform.machine()}"


def _anchor(results: Results) -> str:
    return escape(results.study.path.stem)


def _section(results: Results, pictures: Pictures) -> str:
    study, rows = results.study, list(results.rows())
    parts = [f'<section id="{_anchor(results)}"><h2>{escape(study.title)}</h2>']
    if study.description:
        parts.append(f"<p>{escape(study.description)}</p>")
    changes = [*study.variants.values(), *(change for axis in study.grid for change in axis.changes)]
    parts.append(_list(f"{change.name}: {change.description}" for change in changes if change.description))
    parts += [_table(table) for table in text_tables.tables(results)]
    if study.references:
        origins = escape(" and ".join(study.origins))
        parts += [f"<h3>Beside {origins}</h3>", _table(_beside(results, rows))]
        parts.append(_list(words.differences(study, rows, results.reductions)))
    parts.append(_list([*words.events(rows), *(f"{sentence}." for sentence in running.broken(rows))]))
    if judged := kept.table(study, rows):
        parts.append(_table(judged))
    if drawn_for := known.table(study, rows):
        parts.append(_table(drawn_for))
    if study.question:
        parts += ["<h3>How often, and why not always</h3>", _list(words.explanation(study, rows))]
    parts += _pictures(results, rows, pictures)
    parts += _found(results)
    parts += ["<h3>What this was computed from</h3>", _list([*words.failures(rows), _timing(results, rows)])]
    parts.append(_details("the study", study.text))
    for name in study.variants:
        parts += [_drawing(results, name), _details(f"resolved diagram of {name}", _resolved(results, name))]
    return "\n".join([*parts, "</section>"])


def _found(results: Results) -> list[str]:
    """What `cosim falsify` has found of the study as it is now, if it was called."""
    folder = results.kept_in / found.FOLDER
    answers = found.read(folder, results.study) if results.study.search else []
    if not answers:
        return []
    violated = [answer for answer in answers if answer["violated"]]
    parts = ["<h3>What violates a requirement</h3>", _table(found_section.table(answers))]
    for answer in violated:
        parts += [_table(found_section.checks(answer)), *found_section.figures(answer, folder)]
    return parts


def _table(table: TextTable) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in table.head)
    body = "\n".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    caption = f"<caption>{escape(table.title)}</caption>" if table.title else ""
    made = f"<table>{caption}<thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table>"
    return made + "".join(f"<p>{escape(note)}</p>" for note in table.notes)


def _beside(results: Results, rows: list[Row]) -> TextTable:
    """Our figures beside those of the study's references."""
    origins = list(results.study.origins)
    lines = []
    for item in words.compared(results.study, rows, results.reductions):
        theirs = [f"{item.theirs[o]:.3g}" if o in item.theirs else "" for o in origins]
        ours = item.ours
        ratios = [f"{ours / item.theirs[o]:.3g}" if ours is not None and item.theirs.get(o) else "" for o in origins]
        lines.append([item.variant, item.metric, "—" if ours is None else f"{ours:.3g}", *theirs, *ratios])
    return TextTable("", ["variant", "metric", "here", *origins, *(f"here / {o}" for o in origins)], lines)


def _pictures(results: Results, rows: list[Row], pictures: Pictures) -> list[str]:
    """Every figure of the study, inlined, and as a file if that is wanted."""
    recorded = results.files() if results.study.records else {}
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for figure in results.study.figures:
            for file in pictures.files(results, figure):
                _draw(figure, results, rows, recorded, file)
            if figure.motion:
                found.append(_figure(figure, _player(figure, recorded)))
                continue
            inline = Path(folder) / f"figure{len(found)}.svg"
            _draw(figure, results, rows, recorded, inline)
            data = base64.b64encode(inline.read_bytes()).decode()
            text = escape(f"{figure.name}. {figure.caption}", quote=True)
            found.append(_figure(figure, f'<img src="data:image/svg+xml;base64,{data}" alt="{text}">'))
    return found


def _draw(figure: Figure, results: Results, rows: list[Row], recorded: dict[str, Path], file: Path) -> None:
    """Draw a figure. Raises: PlotError, at the figure's place in the study."""
    with _placed(figure):
        if figure.motion:
            path, motion = figure.moving(recorded)
            with open_result(path) as result:
                animation.animate(result, motion, file)
        elif figure.distribution:
            distribution.draw(figure.distribution, _groups(results.study, rows, figure.distribution.metric), file)
        else:
            figure.draw(recorded, file)


def _player(figure: Figure, recorded: dict[str, Path]) -> str:
    """A figure that moves, as a player. Raises: PlotError, at the figure's place in the study."""
    with _placed(figure):
        path, motion = figure.moving(recorded)
        with open_result(path) as result:
            moving = motions.read(result, motions.find(result, motion))
        return player.fragment(moving, f"{figure.name}. {figure.caption}")


@contextmanager
def _placed(figure: Figure) -> Iterator[None]:
    """What cannot be drawn is told at the figure's place in the study."""
    try:
        yield
    except PlotError as error:
        position = error.position or figure.position
        raise PlotError(f"`figures.{figure.name}`: {error.message}", position, error.fix) from None


def _figure(figure: Figure, shown: str) -> str:
    return f"<figure>{shown}<figcaption><b>{escape(figure.name)}.</b> {escape(figure.caption)}</figcaption></figure>"


def _groups(study: Study, rows: list[Row], metric: str) -> dict[str, dict[str, np.ndarray]]:
    """For each point of the grid the values of a metric in each variant; an axis with one value is not told."""
    found: dict[str, dict[str, list[float | None]]] = {}
    axes = [axis for axis in study.grid if len(axis.values) > 1]
    for row in rows:
        labels = [(axis, row_figures.label(study, row, axis.name)) for axis in axes]
        point = ", ".join(label if axis.changes else f"{axis.name} = {label}" for axis, label in labels)
        found.setdefault(point, {}).setdefault(row["variant"], []).append(scalar(row["metrics"].get(metric)))
    return {point: {name: np.array(v, float) for name, v in groups.items()} for point, groups in found.items()}


def _timing(results: Results, rows: list[Row]) -> str:
    solve = sum(row["seconds"] for row in rows)
    return (
        f"{results.total} runs, {results.ran} of them in this call, which took {results.seconds:.3g} s; "
        f"solving takes {solve / max(len(rows), 1):.3g} s a run, {solve:.3g} s in all."
    )


def _list(sentences: Iterable[str]) -> str:
    items = "\n".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f"<ul>{items}</ul>" if items else ""


def _resolved(results: Results, variant: str) -> str:
    return results.variants.base(variant).diagram.resolved()


def _drawing(results: Results, variant: str) -> str:
    """The blocks and wires of a variant; marked, those that differ from the study's first one."""
    first, network = results.variants.base(next(iter(results.study.variants))), results.variants.base(variant)
    drawn = svg.svg(shapes.drawing(network, marks.changed(network.diagram, first.diagram)))
    data = base64.b64encode(drawn.encode()).decode()
    shown = (
        f'<img style="max-width: 100%" src="data:image/svg+xml;base64,{data}" alt="{escape(network.diagram.title)}">'
    )
    return f"<details><summary>drawing of {escape(variant)}</summary>{shown}</details>"


def _details(title: str, text: str) -> str:
    return f"<details><summary>{escape(title)}</summary><pre>{escape(text)}</pre></details>"
