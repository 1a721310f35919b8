"""Results made up for tests and measurements of the report: folders as `mazebench eval --record` writes them."""

from __future__ import annotations

import json
import pathlib
import types
from typing import Any

import numpy as np
import pydantic

from mazebench.evaluation.chunk import Result, to_record
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import make_plan
from mazebench.maps.benchmark import load_mazes, manifest_hash
from mazebench.maps.maze import cell_to_point, path_through_walls
from mazebench.results.metrics import summarize
from mazebench.results.played import mazes_hash
from mazebench.results.reading import EPISODES, SUMMARY
from mazebench.results.records import Figures, Record
from mazebench.results.trajectories import TRAJECTORIES, Trajectory, save_trajectories
from mazebench.storage.json_files import write_json
from mazebench.tasks.observation import state_errors
from mazebench.tasks.task import Task, resolve_for_evaluation
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.trials import Trial, select_trials

NASTY = "</script><script>window.hacked=1</script><img src=x onerror=window.hacked=1>"
MADE_AGENTS = ("mah", "random", NASTY)
_STEP = 0.3  # m
PROVENANCE = make_plan(eval_options("random")).provenance.model_dump()


def make_record(index: int, **values: Any) -> Record:
    """Returns the record of an episode of which only some values matter."""
    cells = {"start": (1, 1), "goal": (1, 1 + values.get("distance", 1))}
    identity = {
        "agent": "x",
        "task": "local",
        "size": 13,
        "split": "eval",
        "episode": index,
        "maze": "m",
        "seed": index,
        "leg": 1,
        "oracle_steps": 4,
    }
    outcome = {"distance": 1, "success": True, "steps": 5, "path_length": 2.0, "shortest_path": 1.0, "spl": 1.0}
    return Record.model_validate(
        identity | cells | outcome | {"episode": index, "seed": index, "spl_grid": 1.0} | values
    )


def make_result(
    folder: pathlib.Path,
    agent: str = "planner",
    task: str = "local",
    size: int = 13,
    skill: float = 0.9,
    distances: tuple[int, ...] = (2, 4),
    episodes_per_distance: int = 1,
    num_mazes: int = 20,
    landmark_distance: int = 5,
    record: bool = True,
    seed: int = 0,
    checkpoint: str | None = None,
    split: str = "eval",
    privileged: bool = False,
    level: int = 1,
    **levels: float,
) -> pathlib.Path:
    """Writes the result of an agent that follows the true path and gives up on the way with probability 1 - skill.

    On a track, all frozen episodes of the first `num_mazes` mazes are played.
    """
    if task in TRACKS:
        options = {"level": level}
    else:
        options = {"size": size, "distances": distances, "landmark_distance": landmark_distance, **levels}
    spec = resolve_for_evaluation(TaskOptions(task=task, split=split, **options))
    trials = [each for each in select_trials(spec, episodes_per_distance) if each.episode.maze < num_mazes]
    rng = np.random.default_rng([len(agent), spec.size, landmark_distance, seed])
    plan = types.SimpleNamespace(options=types.SimpleNamespace(agent=agent), task=spec, trials=trials)
    records, drives = [], []
    for number, trial in enumerate(trials):
        success = bool(rng.random() < skill ** (trial.distance / 4))
        drives.append(_drive(spec, trial, success, rng))
        driven = float(np.linalg.norm(np.diff(drives[-1].pose[:, :2].astype(float), axis=0), axis=1).sum())
        result = Result(number, success, len(drives[-1].pose) - 1, driven, blocked=False, kept=())
        records.append(to_record(plan, result))
    folder.mkdir(parents=True)
    (folder / EPISODES).write_text("".join(each.to_line() for each in records))
    if record:
        save_trajectories(folder / TRAJECTORIES, drives)
    origin = PROVENANCE | {
        "benchmark_manifest_sha256": manifest_hash(spec.options.benchmark),
        "checkpoint_sha256": checkpoint,
        "mazes_sha256": mazes_hash(spec),
        "seed": seed,
        "command": ["mazebench", "eval", "--agent", agent],
        "packages": {"mazebench-mujoco": "0.1.0", "numpy": np.__version__},
        "python": "3.11.7",
    }
    content = {
        "agent": agent,
        "task": spec.options.to_json(),
        "benchmark": spec.options.benchmark,
        "episodes": len(records),
    }
    write_json(folder / SUMMARY, content | {"provenance": origin, "privileged": privileged})
    return _set_means(folder, records)


def make_results(folder: pathlib.Path) -> pathlib.Path:
    """Writes a few results of three agents, of which one has a name like an attack."""
    for number, agent in enumerate(MADE_AGENTS):
        here, few = folder / str(number), {"skill": 0.9, "num_mazes": 2}
        make_result(here / "local", agent, skill=0.5, num_mazes=4, episodes_per_distance=2)
        make_result(here / "local-15", agent, size=15, record=False, **few)
        make_result(here / "routes", agent, "hierarchical", **few)
        make_result(here / "flip", agent, "hierarchical", map_flip=0.2, **few)
        make_result(here / "noise", agent, position_noise=0.5, record=False, **few)
    return folder


def read_summary(folder: pathlib.Path) -> dict[str, Any]:
    """Returns the content of the summary."""
    return json.loads((folder / SUMMARY).read_text())


def edit_summary(folder: pathlib.Path, **changes: Any) -> pathlib.Path:
    """Puts other values into the summary."""
    write_json(folder / SUMMARY, read_summary(folder) | changes)
    return folder


def edit_task(folder: pathlib.Path, **changes: Any) -> pathlib.Path:
    """Puts other values into the summary's task."""
    return edit_summary(folder, task=read_summary(folder)["task"] | changes)


def edit_records(folder: pathlib.Path, edit: Any) -> pathlib.Path:
    """Replaces each record by what `edit` makes of its fields, and the summary's means by theirs."""
    lines = (folder / EPISODES).read_text().splitlines()
    records = [Record(**edit(Record.model_validate_json(line).model_dump())) for line in lines]
    (folder / EPISODES).write_text("".join(record.to_line() for record in records))
    return _set_means(folder, records)


def of_own_mazes(folder: pathlib.Path, name: str) -> pathlib.Path:
    """Makes the result one of mazes that are not the benchmark's, called `name`-00 and so on, with files of them."""
    summary, used = read_summary(folder), set()
    edit_records(
        folder,
        lambda record: record | {"split": "custom", "maze": used.add(record["maze"]) or f"{name}{record['maze'][-3:]}"},
    )
    maps = folder / "maps"
    maps.mkdir()
    for maze in load_mazes(summary["task"]["size"], "eval"):
        if maze.name in used:
            rows = ("".join("#" if wall else "." for wall in row) for row in maze.walls)
            (maps / f"{name}{maze.name[-3:]}.txt").write_text("\n".join(rows) + "\n")
    provenance = summary["provenance"] | {"mazes_sha256": mazes_hash(Task.of(mazes=maps))}
    return edit_summary(folder, task=summary["task"] | {"mazes": str(maps)}, provenance=provenance)


def _set_means(folder: pathlib.Path, records: list[Record]) -> pathlib.Path:
    figures = pydantic.TypeAdapter(dict[str, Figures | dict[str, Figures]])
    return edit_summary(folder, **figures.dump_python(summarize(records)))


def _drive(spec: Task, trial: Trial, success: bool, rng: np.random.Generator) -> Trajectory:
    """Drives along the shortest path with some jitter, only a part of it without success."""
    episode, maze = trial.episode, spec.mazes[trial.episode.maze]
    points = cell_to_point(np.array(path_through_walls(maze.walls, episode.start, episode.goal)), spec.size)
    distances = np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1).cumsum()
    end = distances[-1] - 0.5 if success else distances[-1] * rng.uniform(0.1, 0.8)
    at = np.arange(0, max(end, _STEP) + _STEP, _STEP)
    place = np.stack([np.interp(at, distances, points[:, axis]) for axis in (0, 1)], axis=-1)
    place += rng.normal(0, 0.04, place.shape)
    if not success:
        place = np.concatenate([place, place[-1] + rng.normal(0, 0.05, (100, 2))])
    heading = np.arctan2(*np.diff(place, axis=0, prepend=place[:1] - [[1e-3, 0]]).T[::-1])
    observed = None
    if spec.options.track is not None and (errors := state_errors(spec, episode)):
        states = np.zeros((len(place), 12))
        states[:, [0, 1, 5]] = np.column_stack([place, heading])
        for error in errors:
            for state in states:
                error(state)
        observed = states[:, [0, 1, 5]].astype(np.float32)
    return Trajectory(np.column_stack([place, heading]).astype(np.float32), observed)
