"""Learning curves: the success rates and losses that training runs logged, over their agent steps."""

from __future__ import annotations

import dataclasses
import os
import pathlib
from collections.abc import Iterable, Sequence
from typing import Any

from mazebench.errors import InputError, remark
from mazebench.report.document import DOCUMENT, FIGURES, Picture, show_picture
from mazebench.report.figures.draw import draw_figure
from mazebench.report.figures.figure import Figure, Panel, Point, Series
from mazebench.report.looks import all_looks
from mazebench.report.report import new_report, write_text
from mazebench.report.table import escape_markdown
from mazebench.storage.json_files import read_json, read_lines
from mazebench.training.run_folder import CHECKPOINTS, CONFIG, METRICS

_STEPS = "env_steps"
SUCCESS, _LOSS = "success_rate_", "_loss"  # how the names of such metrics begin, and end
_MARKS = 12  # on a curve


@dataclasses.dataclass(frozen=True)
class Run:
    """What a training run logged."""

    name: str
    config: dict[str, Any]
    lines: tuple[dict[str, float], ...]  # metrics by name; success rates are in the lines of milestones only

    def last(self, metric: str) -> str:
        """Returns the last value of a metric in words; nothing if there is none."""
        values = [line[metric] for line in self.lines if metric in line]
        return f"{values[-1]:.3f}" if values else ""


def find_runs(paths: Iterable[pathlib.Path]) -> list[pathlib.Path]:
    """Returns the folders of training runs at or below `paths`, each once. Hidden folders are left out."""
    found = {}
    for path in paths:
        for folder, subfolders, files in os.walk(path):
            if CONFIG in files and CHECKPOINTS in subfolders:
                found[pathlib.Path(folder).resolve()] = pathlib.Path(folder)
            subfolders[:] = sorted(name for name in subfolders if not name.startswith("."))
    return list(found.values())


def write_learning_curves(folders: Sequence[pathlib.Path], out: pathlib.Path) -> list[Run]:
    """Writes figures of all runs and a document with them to the folder `out`, and returns the runs.

    It warns with a `Remark` of each run that is skipped.

    Args:
      folders: of training runs, at least one.
      out: an empty or new folder, or one with an earlier report, which is replaced.

    Raises:
      InputError: if no run has logged anything, or `out` can't be used.
    """
    runs = [run for folder, name in zip(folders, _names(folders), strict=True) if (run := read_run(folder, name))]
    if not runs:
        raise InputError("expected training runs with metrics, found none to report")
    looks = all_looks([run.name for run in runs])
    metrics = list(dict.fromkeys(metric for run in runs for line in run.lines for metric in line))
    rates = sorted((metric for metric in metrics if metric.startswith(SUCCESS)), key=lambda rate: (len(rate), rate))
    losses = [metric for metric in metrics if metric.endswith(_LOSS)]
    of_rates = tuple(_panel(runs, rate, f"distance {rate.removeprefix(SUCCESS)}") for rate in rates)
    of_losses = tuple(_panel(runs, loss, loss.replace("_", " ")) for loss in losses)
    lines = ["# Learning curves", _table(runs, rates)]
    with new_report(out):
        for name, title, note, panels in (
            ("success", "Success rate by distance", "On held-out mazes, at each milestone.", of_rates),
            ("losses", "Losses", f"Of the training, as {METRICS} has them.", of_losses),
        ):
            if panels:
                draw_figure(Figure(name, title, note, panels, looks, panel_height=1.9), out / FIGURES / name)
                lines += [f"## {title}", note, show_picture(Picture(name, title, note))]
        write_text(out / DOCUMENT, "\n\n".join(lines) + "\n")
    return runs


def read_run(folder: pathlib.Path, name: str) -> Run | None:
    """Returns what a run logged, but for a line that is written just now; nothing if it logged nothing yet."""
    try:
        config = read_json(folder / CONFIG)
        lines = tuple(filter(None, map(_parse, read_lines(folder / METRICS))))
    except InputError as error:
        remark(f"{error}; skipped")
        return None
    if not lines or not isinstance(config, dict):
        remark(f"{folder}: expected a training run with metrics, found none yet; skipped")
        return None
    return Run(name, config, lines)


def _names(folders: Sequence[pathlib.Path]) -> list[str]:
    """Returns the folders' names, as short as they can be while no two are alike."""
    whole = [folder.resolve() for folder in folders]
    common = whole[0].parent if len(whole) == 1 else os.path.commonpath(whole)
    return [str(folder.relative_to(common)) for folder in whole]


def _parse(found: Any) -> dict[str, float]:
    """Returns the numbers of a line; nothing if it has no steps."""
    if not isinstance(found, dict):
        return {}
    values = {name: value for name, value in found.items() if type(value) in (int, float) and abs(value) < 1e300}
    return values if _STEPS in values else {}


def _table(runs: Sequence[Run], rates: Sequence[str]) -> str:
    head = ("run", "agent", "seed", "agent steps", "updates", *(f"success, {rate[len(SUCCESS) :]}" for rate in rates))
    lines = [head, ("---",) * len(head)]
    for run in runs:
        of_config = [escape_markdown(str(run.config.get(key, ""))) for key in ("agent", "seed")]
        counts = [f"{run.lines[-1].get(name, 0):,}" for name in (_STEPS, "updates")]
        lines.append((escape_markdown(run.name), *of_config, *counts, *map(run.last, rates)))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines).rstrip()


def _panel(runs: Sequence[Run], metric: str, title: str) -> Panel:
    """Returns a curve for each run."""
    series = []
    for run in runs:
        points = tuple(Point(line[_STEPS], line[metric]) for line in run.lines if metric in line)
        series.append(Series(run.name, points, mark_every=-(-len(points) // _MARKS) or 1))
    is_rate = metric.startswith(SUCCESS)
    return Panel(title, "agent steps", tuple(series), y_range=(-0.05, 1.05) if is_rate else None)
