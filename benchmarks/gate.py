"""Hashes what no change of the code may move: episodes, states, weights, and the values that are frozen.

    python -m benchmarks.gate before.json             writes the hashes
    python -m benchmarks.gate --against before.json   makes them again and names those that differ

Weights depend on the processor, so both runs must be on one machine.
"""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from typing import Any

import numpy as np
from safetensors.numpy import load_file

import mazebench
from mazebench.maps.benchmark import (
    ALL_SPLITS,
    FROZEN_SPLITS,
    KINDS_SIZE,
    PAPER_BENCHMARK,
    SIZES,
    SPLITS,
    TRACKS_BENCHMARK,
    load_kind_mazes,
    load_mazes,
)
from mazebench.tasks.streams import ADRIFT, BUILDING, REBUILT, ROUGH
from mazebench.tasks.trials import benchmark_task_sizes, frozen_trials

PAPER_AGENTS = ("planner", "planner-closed-loop", "oracle", "random", "mah", "dqn", "mmn", "navigator")
PAPER_SETTINGS: dict[str, dict[str, Any]] = {
    "local": {},
    "hierarchical": {"task": "hierarchical"},
    "flip": {"map_flip": 0.1},
    "warp": {"map_warp": 0.1},
    "noise": {"position_noise": 0.5},
}
TRACKS = {BUILDING: 1, REBUILT: 2, ADRIFT: 3, ROUGH: 3}  # the level of each
COLUMNS = ("episode", "maze", "seed", "success", "steps", "path_length")
VARIANTS: dict[str, dict[str, Any]] = {
    "local": {"size": 13},
    "hierarchical": {"task": "hierarchical", "size": 15},
    "imperfect": {"map_flip": 0.1, "map_warp": 0.1, "position_noise": 0.5},
    "goals": {"num_goals": 3, "context_size": 25, "sensors": ("lidar",), "lidar_noise": "turtlebot3"},
    "continuous": {"actions": "velocity", "odometry_noise": 0.2},
    "fresh": {"kinds": ("dfs", "house", "cave"), "fresh": True, "size": 21},
    "building": {"task": "building", "level": (1, 2, 3)},
    "rough": {"task": "rough", "level": 3},
}
NUM_ENVS, NUM_STEPS = 4, 1000
SMALL = "--env-steps 960 --checkpoint-steps 960 --eval-mazes 1 --set num_envs=16 --set min_rows=320"
TRAININGS = {
    "dqn": f"{SMALL} --set steps_per_update=32",
    "mmn": f"{SMALL} --set steps_per_update=80",
}


def episodes() -> Iterator[tuple[str, str]]:
    """Yields a name and a hash of the numbers in `episodes.jsonl` for each evaluation, in training mazes."""
    distances = {"distances": (2, 6, 10), "episodes_per_distance": 1, "split": "train"}
    runs = {
        f"{agent} {name}": (agent, (distances if "task" not in setting else {"split": "train"}) | setting)
        for agent in PAPER_AGENTS
        for name, setting in PAPER_SETTINGS.items()
        if agent != "dqn" or name == "local"
    }
    runs |= {
        f"navigator {track} {level}": ("navigator", distances | {"task": track, "level": level, "distances": (20, 30)})
        for track, level in TRACKS.items()
    }
    for name, (agent, options) in runs.items():
        with tempfile.TemporaryDirectory() as folder:
            mazebench.evaluate(agent, out=folder, **options)
            lines = pathlib.Path(folder, "episodes.jsonl").read_text(encoding="utf-8").splitlines()
        rows = [[json.loads(line)[column] for column in COLUMNS] for line in lines]
        yield f"episodes: {name}", _hash(json.dumps(rows).encode())


def states() -> Iterator[tuple[str, str]]:
    """Yields a name and a hash of all states and contexts in 1,000 steps of random actions for each task."""
    for name, options in VARIANTS.items():
        options = dict(options)
        envs = mazebench.make_vec(options.pop("task", "local"), NUM_ENVS, **options)
        rng, digest = np.random.default_rng(0), hashlib.sha256()
        observation, _ = envs.reset(seed=0)
        for _ in range(NUM_STEPS):
            for key in sorted(observation):
                digest.update(np.ascontiguousarray(observation[key]).tobytes())
            shape = envs.action_space.shape
            actions = rng.integers(6, size=shape) if len(shape) == 1 else rng.uniform(-1, 1, size=shape)
            observation, reward, terminated, truncated, _ = envs.step(actions)
            digest.update(np.asarray(reward, dtype=float).tobytes() + terminated.tobytes() + truncated.tobytes())
        envs.close()
        yield f"states: {name}", digest.hexdigest()


def weights() -> Iterator[tuple[str, str]]:
    """Yields a name and a hash of the tensors of the last checkpoint for each tiny training."""
    for agent, options in TRAININGS.items():
        with tempfile.TemporaryDirectory() as folder:
            words = ["-m", "mazebench", "train", "--agent", agent, *options.split(), "--out", f"{folder}/run"]
            done = subprocess.run([sys.executable, *words], capture_output=True, text=True)
            if done.returncode:
                sys.exit(f"{agent}: {done.stderr}")
            file = max(pathlib.Path(folder).rglob("agent.safetensors"))  # folders have the steps as names
            tensors = load_file(file)
        yield f"weights: {agent}", _hash(*(name.encode() + tensors[name].tobytes() for name in sorted(tensors)))


def frozen() -> Iterator[tuple[str, str]]:
    """Yields a name and a hash of the frozen values: walls of mazes, episodes, and the oracle's steps in them."""
    mazes = {f"{size} {split}": load_mazes(size, split) for size in SIZES for split in SPLITS}
    mazes |= {f"tracks {split}": load_kind_mazes(split) for split in ALL_SPLITS}
    for name, group in mazes.items():
        yield f"frozen: mazes {name}", _hash(*(maze.walls.tobytes() for maze in group))

    episodes = [(task, size, PAPER_BENCHMARK, "eval") for task, size, _ in benchmark_task_sizes()]
    episodes += [("local", KINDS_SIZE, TRACKS_BENCHMARK, split) for split in FROZEN_SPLITS]
    for task, size, benchmark, split in episodes:
        trials = frozen_trials(task, size, benchmark, split)
        rows = [(*dataclasses.astuple(trial.episode), trial.distance, trial.shortest_path) for trial in trials]
        yield f"frozen: episodes {task} {size} {split}", _hash(json.dumps(rows).encode())
        steps = [trial.oracle_steps for trial in trials]
        yield f"frozen: oracle {task} {size} {split}", _hash(json.dumps(steps).encode())


def _hash(*contents: bytes) -> str:
    return hashlib.sha256(b"".join(contents)).hexdigest()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=pathlib.Path, help="the hashes, as JSON")
    parser.add_argument("--against", action="store_true", help="compare with the file instead of writing it")
    parser.add_argument(
        "--only", default="", help="make only the hashes of this kind: frozen, states, weights, episodes"
    )
    arguments = parser.parse_args()
    kinds = [make for make in (frozen, states, weights, episodes) if make.__name__.startswith(arguments.only)]
    before = json.loads(arguments.file.read_text(encoding="utf-8")) if arguments.against else {}
    hashes, differing = {}, 0
    for name, value in (pair for make in kinds for pair in make()):
        hashes[name] = value
        if arguments.against:
            verdict = "the same" if before.get(name) == value else "DIFFERS" if name in before else "NEW"
            differing += verdict != "the same"
            print(f"{name}: {verdict}", flush=True)
    if not arguments.against:
        arguments.file.write_text(json.dumps(hashes, indent=1) + "\n", encoding="utf-8")
        return
    missing = [name for name in before if name not in hashes and name.startswith(arguments.only)]
    if differing or missing:
        sys.exit(f"{differing} of {len(hashes)} differ; missing: {missing}")
    print(f"all {len(hashes)} are the same")


if __name__ == "__main__":
    main()
