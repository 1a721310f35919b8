"""Learning curves: the success rates and losses that training runs logged, over their agent steps."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import pandas as pd

from mazebench.errors import InputError, remark
from mazebench.report.episodes import folders_below
from mazebench.report.figures import Panel, draw_panels, save
from mazebench.report.report_files import DOCUMENT, FIGURES, new_report
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
    """Returns the folders of training runs at or below `paths`."""
    return folders_below(paths, lambda names: names >= {CONFIG, CHECKPOINTS})


def write_learning_curves(folders: Sequence[pathlib.Path], out: pathlib.Path) -> list[Run]:
    """Writes figures of all runs and a document with them to the folder `out`, and returns the runs.

    It warns with a `Remark` of each run that is skipped.

    Args:
      folders: of training runs, at least one.
      out: an empty or new folder, or one with an earlier report, which is replaced.

    Raises:
      InputError: if no run has logged anything, or `out` can't be used.
    """
    # Names are as short as they can be while no two are alike.
    whole = [folder.resolve() for folder in folders]
    common = os.path.commonpath(whole) if len(whole) > 1 else whole[0].parent
    runs = [run for folder in whole if (run := read_run(folder, str(folder.relative_to(common))))]
    if not runs:
        raise InputError("expected training runs with metrics, found none to report")
    metrics = dict.fromkeys(metric for run in runs for metric in run.lines)
    rates = sorted((metric for metric in metrics if metric.startswith(SUCCESS)), key=_track_and_distance)
    losses = [metric for metric in metrics if metric.endswith(_LOSS)]
    lines = ["# Learning curves", to_markdown(_overview(runs, rates)).rstrip()]
    with new_report(out):
        for name, title, note, shown in (
            ("success", "Success rate by distance", "On held-out mazes, at each milestone.", rates),
            ("losses", "Losses", f"Of the training, as {METRICS} has them.", losses),
        ):
            if shown:
                panels = [_panel(runs, metric) for metric in shown]
                save(draw_panels(title, panels, [run.name for run in runs], height=1.9), out / FIGURES / name)
                lines += [f"## {title}", note, f"![{title}]({FIGURES}/{name}.png)"]
        (out / DOCUMENT).write_text("\n\n".join(lines) + "\n", "utf-8")
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


def _overview(runs: Sequence[Run], rates: Sequence[str]) -> pd.DataFrame:
    """Returns a row for each run: whose it is, and its last steps, updates and success rates."""
    rows = {}
    for run in runs:
        last = run.lines.ffill().iloc[-1]
        rows[run.name] = {key: escape_markdown(str(run.config.get(key, ""))) for key in ("agent", "seed")}
        rows[run.name] |= {"agent steps": f"{last[_STEPS]:,.0f}", "updates": f"{last.get('updates', 0):,.0f}"}
        rows[run.name] |= {
            f"success, {rate.removeprefix(SUCCESS)}": f"{last[rate]:.3f}" if rate in last else "" for rate in rates
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis(columns="run")


def _panel(runs: Sequence[Run], metric: str) -> Panel:
    """Returns a curve for each run."""
    curves = [
        pd.DataFrame({"column": run.name, "x": run.lines[_STEPS], "value": run.lines[metric]}).dropna()
        for run in runs
        if metric in run.lines
    ]
    is_rate, title = metric.startswith(SUCCESS), metric.replace("_", " ")
    if is_rate:
        title = "{}, distance {}".format(*_track_and_distance(metric)).removeprefix(", ")
    return Panel(title, "agent steps", pd.concat(curves, ignore_index=True), is_score=is_rate)


def _track_and_distance(rate: str) -> tuple[str, int]:
    """Returns what sorts the name of a success rate: by track, where there are several, then by distance."""
    track, _, distance = rate.removeprefix(SUCCESS).rpartition("_")
    return track, int(distance)
