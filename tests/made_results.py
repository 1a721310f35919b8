"""Results made up for tests and measurements of the report: folders as `mazebench eval --record` writes them."""

from __future__ import annotations

import json
import pathlib
from typing import Any

import numpy as np

from mazebench.evaluation.metrics import spl, summarize
from mazebench.evaluation.protocol import Trial, select_trials
from mazebench.evaluation.trajectories import TRAJECTORIES, Trajectory, pack_trajectories, save_trajectories
from mazebench.maps.benchmark import VERSION, load_mazes, manifest_hash
from mazebench.maps.maze import Maze, cell_to_point, path_through_walls
from mazebench.records import EPISODES, SUMMARY, to_line, write_json
from mazebench.tasks.spec import Perturbation, TaskSpec

_STEP = 0.3  # m


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
    **perturbation: float,
) -> pathlib.Path:
    """Writes the result of an agent that follows the shown map and gives up on the way with probability 1 - skill."""
    mazes = load_mazes(size, "eval")
    spec = TaskSpec(
        task, mazes, distances, landmark_distance=landmark_distance, perturbation=Perturbation(**perturbation)
    )
    rng = np.random.default_rng([len(agent), size, landmark_distance, seed])
    trials = [
        trial
        for trial in select_trials(task, mazes, True, distances, episodes_per_distance)
        if trial.episode.maze < num_mazes
    ]
    all_perturbations = {"map_flip": 0.0, "map_warp": 0.0, "position_noise": 0.0} | perturbation
    head = {"agent": agent, "task": task, "size": size, "split": "eval"}
    records, drives = [], []
    for number, trial in enumerate(trials):
        success = bool(rng.random() < skill ** (trial.distance / 4))
        drive = _drive(spec, trial, success, rng)
        drives.append(drive)
        records.append(head | _record(number, trial, mazes[trial.episode.maze], success, drive) | all_perturbations)
    folder.mkdir(parents=True)
    (folder / EPISODES).write_text("".join(map(to_line, records)))
    if record:
        save_trajectories(folder / TRAJECTORIES, pack_trajectories(drives))
    provenance = {
        "benchmark_manifest_sha256": manifest_hash(),
        "checkpoint_sha256": checkpoint,
        "options": {"landmark_distance": landmark_distance, "seed": seed},
        "command": ["mazebench", "eval", "--agent", agent],
        "packages": {"mazebench-mujoco": "0.1.0", "numpy": np.__version__},
    }
    content = {"benchmark": VERSION, "episodes": len(records), "perturbation": all_perturbations}
    write_json(folder / SUMMARY, head | content | {"provenance": provenance} | summarize(records))
    return folder


def edit_summary(folder: pathlib.Path, **changes: Any) -> pathlib.Path:
    """Puts other values into a summary."""
    write_json(folder / SUMMARY, json.loads((folder / SUMMARY).read_text()) | changes)
    return folder


def make_paper_suite(folder: pathlib.Path, agent: str, skill: float) -> None:
    """What the paper evaluates, some 4,000 episodes, as a run of a suite lays it out."""
    everything = tuple(range(1, 16))
    make_result(folder / "local-13", agent, skill=skill, distances=everything, episodes_per_distance=5)
    for size in (15, 17, 19, 21):
        make_result(folder / f"local-{size}", agent, size=size, skill=skill, distances=everything)
    for landmark_distance in range(1, 6):
        part = folder / f"hierarchical-13-k{landmark_distance}"
        make_result(part, agent, "hierarchical", skill=skill, landmark_distance=landmark_distance)
    for flip in (0.05, 0.1, 0.2, 0.3):
        part = folder / f"flip-{flip:g}"
        make_result(part, agent, "hierarchical", skill=skill * (1 - flip), map_flip=flip)
    for warp in (0.1, 0.2):
        part = folder / f"warp-{warp:g}"
        make_result(part, agent, skill=skill * (1 - warp), distances=(2, 4, 6, 8, 10), map_warp=warp)
    for tenth in range(1, 11):
        part = folder / f"noise-{tenth / 10:g}"
        skill_left = skill * (1 - 0.05 * tenth)
        make_result(part, agent, skill=skill_left, distances=(2, 4, 6, 8, 10), position_noise=tenth / 10)


def _drive(spec: TaskSpec, trial: Trial, success: bool, rng: np.random.Generator) -> Trajectory:
    """Along the shortest path with some jitter, a part of the way if it fails."""
    episode, maze = trial.episode, spec.mazes[trial.episode.maze]
    shown = spec.show(episode)
    route = spec.route(episode, shown)
    cells = np.array(path_through_walls(maze.walls, episode.start, episode.goal))
    points = cell_to_point(cells, spec.size)
    distances = np.linalg.norm(np.diff(points, axis=0, prepend=points[:1]), axis=1).cumsum()
    end = distances[-1] - 0.5 if success else distances[-1] * rng.uniform(0.1, 0.8)
    at = np.arange(0, max(end, _STEP) + _STEP, _STEP)
    place = np.stack([np.interp(at, distances, points[:, axis]) for axis in (0, 1)], axis=-1)
    place += rng.normal(0, 0.04, place.shape)
    if not success:
        place = np.concatenate([place, place[-1] + rng.normal(0, 0.05, (100, 2))])
    heading = np.arctan2(*np.diff(place, axis=0, prepend=place[:1] - [[1e-3, 0]]).T[::-1])
    walls = getattr(shown, "seen_walls", lambda: shown.walls)()
    landmarks = np.array([row * spec.size + column for row, column in route.cells[1:]], dtype=np.int32)
    return Trajectory(np.column_stack([place, heading]).astype(np.float16), walls, landmarks)


def of_own_mazes(folder: pathlib.Path, name: str) -> pathlib.Path:
    """Makes a result one of mazes that are not the benchmark's, called `name`-00 and so on."""
    text = (folder / EPISODES).read_text()
    (folder / EPISODES).write_text(text.replace('"split":"eval"', '"split":"custom"').replace("13-eval", name))
    edit_summary(folder, split="custom")
    return folder


def _record(number: int, trial: Trial, maze: Maze, success: bool, drive: Trajectory) -> dict[str, Any]:
    driven = float(np.linalg.norm(np.diff(drive.pose[:, :2].astype(float), axis=0), axis=1).sum())
    shortest = np.array([trial.shortest_path, float(trial.distance)])
    scores = spl(np.array([success] * 2), shortest, np.array([driven] * 2))
    return {
        "episode": number,
        "maze": maze.name,
        "start": list(trial.episode.start),
        "goal": list(trial.episode.goal),
        "distance": trial.distance,
        "success": success,
        "steps": len(drive.pose) - 1,
        "path_length": driven,
        "shortest_path": trial.shortest_path,
        "spl": float(scores[0]),
        "spl_grid": float(scores[1]),
        "seed": trial.episode.seed,
    }
