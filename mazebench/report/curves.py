"""Learning curves: the success rates and losses that training runs logged, over their agent steps."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import pandas as pd

from mazebench.errors import InputError, remark
from mazebench.report.figures import Panel, draw_panels, save
from mazebench.report.report_files import DOCUMENT, FIGURES, new_report, write_text
from mazebench.report.table import escape_markdown, to_markdown
from mazebench.storage.json_files import read_json, read_lines
from mazebench.training.run_folder import CHECKPOINTS, CONFIG, METRICS

SUCCESS, _LOSS = "success_rate_", "_loss"  # how the names of such metrics begin, and end
_STEPS = "env_steps"


class Run(NamedTuple):
    """The log of a training run."""

    name: str
    config: dict[str, Any]
    lines: pd.DataFrame  # metrics by name, with their steps; success rates are in the lines of milestones only


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
    metrics = list(dict.fromkeys(metric for run in runs for metric in run.lines))
    rates = sorted((metric for metric in metrics if metric.startswith(SUCCESS)), key=_track_and_distance)
    losses = [metric for metric in metrics if metric.endswith(_LOSS)]
    of_rates = [_panel(runs, rate, _title(rate)) for rate in rates]
    of_losses = [_panel(runs, loss, loss.replace("_", " "))._replace(y_range=None) for loss in losses]
    lines = ["# Learning curves", to_markdown(_overview(runs, rates)).rstrip()]
    with new_report(out):
        for name, title, note, panels in (
            ("success", "Success rate by distance", "On held-out mazes, at each milestone.", of_rates),
            ("losses", "Losses", f"Of the training, as {METRICS} has them.", of_losses),
        ):
            if panels:
                save(draw_panels(title, panels, [run.name for run in runs], height=1.9), out / FIGURES / name)
                lines += [f"## {title}", note, f"![{title}]({FIGURES}/{name}.png)"]
        write_text(out / DOCUMENT, "\n\n".join(lines) + "\n")
    return runs


def read_run(folder: pathlib.Path, name: str) -> Run | None:
    """Returns what a run logged, but for a line that is written just now; nothing if it logged nothing yet."""
    try:
        config = read_json(folder / CONFIG)
        lines = read_lines(folder / METRICS)
    except InputError as error:
        remark(f"{error}; skipped")
        return None
    if not lines:
        remark(f"{folder}: expected a training run with metrics, found none yet; skipped")
        return None
    return Run(name, config, pd.DataFrame(lines))


def _names(folders: Sequence[pathlib.Path]) -> list[str]:
    """Returns the folders' names, as short as they can be while no two are alike."""
    whole = [folder.resolve() for folder in folders]
    common = whole[0].parent if len(whole) == 1 else os.path.commonpath(whole)
    return [str(folder.relative_to(common)) for folder in whole]


def _overview(runs: Sequence[Run], rates: Sequence[str]) -> pd.DataFrame:
    """Returns a row for each run: whose it is, its steps and updates, and its last success rates."""
    rows = {}
    for run in runs:
        rows[run.name] = {key: escape_markdown(str(run.config.get(key, ""))) for key in ("agent", "seed")}
        for metric, name in ((_STEPS, "agent steps"), ("updates", "updates")):
            rows[run.name][name] = f"{run.lines.get(metric, pd.Series([0])).iloc[-1]:,.0f}"
        for rate in rates:
            found = run.lines.get(rate, pd.Series(dtype=float)).dropna()
            rows[run.name][f"success, {rate.removeprefix(SUCCESS)}"] = f"{found.iloc[-1]:.3f}" if len(found) else ""
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("run")


def _panel(runs: Sequence[Run], metric: str, title: str) -> Panel:
    """Returns a curve for each run."""
    curves = [
        pd.DataFrame({"column": run.name, "x": run.lines[_STEPS], "value": run.lines[metric]}).dropna()
        for run in runs
        if metric in run.lines
    ]
    return Panel(title, "agent steps", pd.concat(curves, ignore_index=True))


def _track_and_distance(rate: str) -> tuple[str, int, str]:
    """Returns what sorts the name of a success rate: by track, where there are several, then by distance."""
    track, _, distance = rate.removeprefix(SUCCESS).rpartition("_")
    return track, len(distance), distance


def _title(rate: str) -> str:
    track, _, distance = _track_and_distance(rate)
    return f"{track}, distance {distance}" if track else f"distance {distance}"
