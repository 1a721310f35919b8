"""Learning curves: the success rates and losses that training runs logged, over their agent steps."""

from __future__ import annotations

import os
import pathlib
from collections.abc import Iterable, Mapping, Sequence

import pandas as pd

from mazebench.errors import InputError, remark
from mazebench.report.episodes import folders_below
from mazebench.report.figures import Panel, draw_panels, save
from mazebench.report.table import escape_markdown, to_markdown
from mazebench.report.write_report import DOCUMENT, FIGURES, new_report
from mazebench.storage.json_files import read_json
from mazebench.training.run_folder import CHECKPOINTS, CONFIG, METRICS, read_metrics

SUCCESS = "success_rate_"  # begins the names of success rates
_STEPS = "env_steps"


def find_runs(paths: Iterable[pathlib.Path]) -> list[pathlib.Path]:
    """Returns the folders of training runs at or below `paths`."""
    return folders_below(paths, lambda names: names >= {CONFIG, CHECKPOINTS})


def write_learning_curves(folders: Sequence[pathlib.Path], out: pathlib.Path) -> int:
    """Writes figures of all runs and a document with them to the folder `out`, and returns the number of runs.

    It warns with a `Remark` of each run that is skipped. An earlier report in `out` is replaced.

    Raises:
      InputError: if no run has logged anything, or `out` can't be used.
    """
    # Names are as short as they can be while no two are alike.
    whole = [folder.resolve() for folder in folders]
    common = os.path.commonpath(whole) if len(whole) > 1 else whole[0].parent
    logs = {}  # metrics by the name of the run, with their steps; success rates are in the lines of milestones only
    rows = {}  # the origin of each run, and its last steps, updates and success rates
    for folder in whole:
        try:
            config, lines = read_json(folder / CONFIG), pd.DataFrame(read_metrics(folder))
        except InputError as error:
            remark(f"{error}; skipped")
            continue
        if lines.empty:
            remark(f"{folder}: expected a training run with metrics, found none yet; skipped")
            continue
        name, last = str(folder.relative_to(common)), lines.ffill().iloc[-1]
        logs[name] = lines
        rows[name] = {key: escape_markdown(str(config.get(key, ""))) for key in ("agent", "seed")}
        rows[name] |= {"agent steps": f"{last[_STEPS]:,.0f}", "updates": f"{last.get('updates', 0):,.0f}"}
        rows[name] |= {rate: f"{value:.3f}" for rate, value in last.items() if str(rate).startswith(SUCCESS)}
    if not logs:
        raise InputError("expected training runs with metrics, found none to report")
    metrics = list(dict.fromkeys(metric for lines in logs.values() for metric in lines))
    rates = sorted((metric for metric in metrics if metric.startswith(SUCCESS)), key=_track_and_distance)
    losses = [metric for metric in metrics if metric.endswith("_loss")]

    columns = ["agent", "seed", "agent steps", "updates", *rates]
    table = pd.DataFrame.from_dict(rows, orient="index").reindex(columns=columns).fillna("")
    table = table.rename(columns=lambda name: name.replace(SUCCESS, "success, ")).rename_axis(columns="run")
    document = ["# Learning curves", to_markdown(table).rstrip()]
    with new_report(out):
        for name, title, note, shown in (
            ("success", "Success rate by distance", "On held-out mazes, at each milestone.", rates),
            ("losses", "Losses", f"Of the training, as {METRICS} has them.", losses),
        ):
            if shown:
                panels = [_panel(logs, metric) for metric in shown]
                save(draw_panels(title, panels, list(logs), height=1.9), out / FIGURES / name)
                document += [f"## {title}", note, f"![{title}]({FIGURES}/{name}.png)"]
        (out / DOCUMENT).write_text("\n\n".join(document) + "\n", "utf-8")
    return len(logs)


def _panel(logs: Mapping[str, pd.DataFrame], metric: str) -> Panel:
    """Returns a curve for each run."""
    curves = [
        pd.DataFrame({"column": name, "x": lines[_STEPS], "value": lines[metric]}).dropna()
        for name, lines in logs.items()
        if metric in lines
    ]
    is_rate, title = metric.startswith(SUCCESS), metric.replace("_", " ")
    if is_rate:
        title = "{}, distance {}".format(*_track_and_distance(metric)).removeprefix(", ")
    return Panel(title, "agent steps", pd.concat(curves, ignore_index=True), is_score=is_rate)


def _track_and_distance(rate: str) -> tuple[str, int]:
    """Returns what sorts the name of a success rate: by track, where there are several, then by distance."""
    track, _, distance = rate.removeprefix(SUCCESS).rpartition("_")
    return track, int(distance)
