"""The figures of README.md and docs/results.md, from the records that are kept; `make results` draws them."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from benchmarks.results.kept import LOCAL, ON_TIME_125, Kept, estimate
from mazebench.report.figures import Panel, draw_panels, draw_table
from mazebench.report.paper_figures import draw_paths, draw_violins
from mazebench.tasks.tracks import LEVELS, STANDING

# Each line's place is its colour and marker, in all figures.
_LOOKS = (
    "navigator", "neural-planner", "navigator without map", "planner-closed-loop", "mmn", "mah", "mah-paper", "dqn",
    "random", "navigator with the true pose", "mmn without model and search", "sb3_agent:FieldPPOAgent", "open path",
    "blocked path", "dagger:Student", "navigator with egocentric (look varied)",
)  # fmt: skip
# What lines are called where they end; others by their label.
_NAMES = {
    "navigator without map": "without the map",
    "navigator with the true pose": "with the true pose",
    "sb3_agent:FieldPPOAgent": "PPO",
    "dagger:Student": "imitation",
    "navigator with egocentric (look varied)": "navigator, camera",
    "mmn without model and search": "mmn, no model and search",
}


def figures(kept: Kept) -> dict[str, Figure]:
    """Returns all figures that pages show, by the names of their files."""
    local = kept.report[LOCAL]
    some = local.values.column.isin(["mmn", "mah", "mah-paper", "dqn", "random", "MMN (paper)"])  # miss some goals
    local = dataclasses.replace(local, values=local.values[some])
    violins = kept.paper[kept.paper.agent.isin(["mmn", "mah", "planner"])]
    agents = ("navigator", "navigator without map", "navigator with the true pose")
    best = (
        *("navigator", "neural-planner", "navigator with egocentric (look varied)", "navigator without map"),
        *("dagger:Student", "sb3_agent:FieldPPOAgent"),
    )
    return {
        "leaderboard": on_time("On-time rate by track", {agent: (agent, (False, True)) for agent in best}, kept),
        "map-worth": on_time("What the map is worth", {agent: (agent, (False, True)) for agent in agents}, kept),
        "what-fails": on_time(
            "Where the navigator is late",
            {"open path": ("navigator", (False,)), "blocked path": ("navigator", (True,))},
            kept,
        ),
        "budget": budget(kept),
        "wrong-maps": wrong_maps(kept),
        "model-and-search": model_and_search(kept),
        "first-training": first_training(kept),
        LOCAL: draw_table(local, _LOOKS),
        **{drawn.name: drawn.figure for drawn in [*draw_violins(violins), *draw_paths(kept.paths)]},
    }


def on_time(title: str, lines: Mapping[str, tuple[str, Sequence[bool]]], kept: Kept) -> Figure:
    """Returns on-time rates by track and level.

    A line is of an agent where the shortest path on the map is open (False), blocked (True), or either.
    """
    points = [
        {"panel": track, "column": label, "x": level - 1, "value": mean.value, "low95": mean.low, "high95": mean.high}
        for label, (agent, is_blocked) in lines.items()
        for track, level, own in kept.on_tracks(agent)
        if len(chosen := own[own.blocked.isin(is_blocked)])
        for mean in [estimate(ON_TIME_125, chosen)]
    ]
    by_track = pd.DataFrame(points).groupby("panel", sort=False)
    panels = [Panel(track, "level", own, dict(enumerate(map(str, LEVELS)))) for track, own in by_track]
    return _figure(title, panels, "on-time rate")


def budget(kept: Kept) -> Figure:
    """Returns the share of episodes that reach the goal within a budget of steps, at level 2 of each track."""
    panels = []
    for track in STANDING:
        points = []
        for agent in ("navigator", "navigator without map", "sb3_agent:FieldPPOAgent", "neural-planner"):
            own = kept.of(agent, f"{track}-2")
            limit = own.oracle_steps.astype(float).fillna(np.inf)
            for factor in np.arange(1.0, 3.01, 0.125):
                value = (own.success & (own.steps <= factor * limit)).mean()
                points.append({"column": agent, "x": factor, "value": value, "low95": value, "high95": value})
        ticks = {x: f"{x:g}" for x in (1.0, 1.25, 2.0, 3.0)}
        panels.append(Panel(f"{track} 2", "budget, times the oracle's steps", pd.DataFrame(points), ticks, True))
    return _figure("Success over the budget of steps", panels)


def wrong_maps(kept: Kept) -> Figure:
    """Returns success rates on wrong maps of the paper's protocol, without a lidar."""
    panels = []
    for title, name in (
        ("Hierarchical, share of cells flipped", "flip-hierarchical-13"),
        ("Local, maps warped by", "warp-local-13"),
    ):
        table = kept.report[name]
        values = table.values[table.values.metric == "success_rate"]
        points = values[values.column.isin(["planner-closed-loop", "mah", "mmn", "navigator"])]
        points = points.assign(x=points.row.cat.codes)
        panels.append(Panel(title, "", points, dict(enumerate(table.x))))
    return _figure("Wrong maps without a lidar", panels)


def model_and_search(kept: Kept) -> Figure:
    """Returns learning curves of mmn, of Q-learning with its reading of the map, and of mah: means over their runs.

    Bars reach from the lowest to the highest run. Milestones count as the nearest tenth of a million steps.
    """
    archives = {"mmn": "mmn", "mmn without model and search": "mmn-model-false", "mah": "mah"}
    ticks, panels = {x: f"{x:g}" for x in (0.2, 0.4, 0.6, 0.8, 1.0)}, []
    for distance in (6, 8, 10):
        curves = [kept.success_rates(archive, distance).assign(column=label) for label, archive in archives.items()]
        points = pd.concat(curves).rename_axis("x").reset_index()
        points = points.rename(columns={"mean": "value", "min": "low95", "max": "high95"})
        panels.append(Panel(f"{distance} cells", "million agent steps", points, ticks))
    title = "Success rate on held-out mazes over training: mean, lowest and highest run"
    return _figure(title, panels)


def first_training(kept: Kept) -> Figure:
    """Returns what the first training of docs/training.md logs: means, lowest and highest values over its runs."""
    lines = pd.concat(kept.training["first-training"])
    kept.read.add("training/first-training")
    by_steps, panels = lines.groupby(lines.env_steps // 1000), []
    for title, name in (
        ("goals reached in training", "success"),
        ("the oracle's action chosen", "agreement"),
    ):
        points = by_steps[name].agg(value="mean", low95="min", high95="max").rename_axis("x").reset_index()
        points = points.assign(column="neural-planner")
        panels.append(Panel(title, "thousand agent steps", points, {x: f"{x}" for x in range(0, 121, 40)}, True))
    return _figure("The first training", panels, "share")


def _figure(title: str, panels: Sequence[Panel], y_name: str = "success rate") -> Figure:
    return draw_panels(title, panels, _LOOKS, y_name, _NAMES)
