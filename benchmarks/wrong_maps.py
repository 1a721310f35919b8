"""Prints agents' success rates and SPL on held-out mazes whose shown maps, or observed poses, are right or wrong.

Call it as `python benchmarks/wrong_maps.py AGENT[=CHECKPOINT]... [--rows NAME,...] [--kind KIND] [--size N]`. Each row
is a task, and each agent a column: success with its 95 % interval over mazes and episodes, and SPL. With two agents or
more, the last columns are the differences of the first one and the second, success and SPL, in the same episodes; if
several checkpoints of one are given, those of their means, with intervals over runs and mazes together. The mazes are
of no split; another --seed draws other ones. The tracks are played with a lidar, the other tasks without.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
import time

import numpy as np

from mazebench.agent import Agent, Interface
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.chunk import run_trials
from mazebench.maps.kinds import generate
from mazebench.results.intervals import Estimate, mean_interval, runs_interval
from mazebench.results.metrics import spl
from mazebench.tasks.build import make_spec
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.trials import draw_trials

_NUM_MAZES = 40
_HIERARCHICAL = {"task": "hierarchical"}
# Options of each task; those of the local task that have no distances are played at 4, 8 and 12 cells, or as much
# farther as the mazes are larger than 13 x 13.
ROWS = {
    "clean": {"distances": tuple(range(1, 16))},
    "right": {},
    "far": {"distances": (16, 20)},
    "flip .1": {"map_flip": 0.1},
    "flip .2": {"map_flip": 0.2},
    "hier": _HIERARCHICAL,
    "hier .05": _HIERARCHICAL | {"map_flip": 0.05},
    "hier .1": _HIERARCHICAL | {"map_flip": 0.1},
    "hier .2": _HIERARCHICAL | {"map_flip": 0.2},
    "warp .1": {"map_warp": 0.1},
    "warp .2": {"map_warp": 0.2},
    "noise 1 m": {"position_noise": 1.0},
    **{
        f"{track} {level}": {"task": track, "level": (level,), "sensors": ("lidar",)}
        for track in ("stale", "sketch", "lost")
        for level in (1, 2, 3)
    },
}
_EPISODES = 2  # a maze and distance


def held_out_task(options: dict, seed: int, num_mazes: int, kind: str = "dfs", size: int = 13) -> TaskSpec:
    """Returns the task of a row in mazes that are drawn like the benchmark's."""
    options = dict(options)
    task = options.pop("task", "local")
    if task == "local":
        options.setdefault("distances", tuple(distance * size // 13 for distance in (4, 8, 12)))
    streams, mazes = np.random.SeedSequence([seed, size]), []
    while len(mazes) < num_mazes:  # but for those in which no goal is as far away
        maze = generate(kind, size, np.random.default_rng(streams.spawn(1)[0]), f"held-out-{len(mazes)}")
        if maze.diameter >= max(options.get("distances", (0,))):
            mazes.append(maze)
    return make_spec(task, maps=mazes, **options)


def outcomes(agent: Agent, spec: TaskSpec, needs_truth: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns the success, the SPL and the maze of each episode, in the order of the trials."""
    trials = list(enumerate(draw_trials(spec, 1 if len(spec.distances) > 9 else _EPISODES)))
    played = run_trials(agent, spec, trials, len(trials), needs_truth=needs_truth)
    ended = sorted((outcome for some in played for outcome in some), key=lambda outcome: outcome.index)
    success = np.array([outcome.success for outcome in ended])
    shortest = np.array([outcome.trial.shortest_path for outcome in ended])
    driven = np.array([outcome.path_length for outcome in ended])
    return success.astype(float), spl(success, shortest, driven), np.array([each.trial.episode.maze for each in ended])


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("agents", nargs="+", metavar="AGENT[=CHECKPOINT]")
    parser.add_argument("--rows", default=",".join(ROWS), help="names of rows, with commas between")
    parser.add_argument("--kind", default="dfs")
    parser.add_argument("--size", type=int, default=13)
    parser.add_argument("--seed", type=int, default=30_000)
    parser.add_argument("--mazes", type=int, default=_NUM_MAZES)
    given = parser.parse_args()
    for name in given.rows.split(","):
        begin, cells = time.perf_counter(), []
        task = held_out_task(ROWS[name], given.seed, given.mazes, given.kind, given.size)
        # By agent, successes and SPL of its checkpoints.
        scores: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
        for agent in given.agents:
            success, lengths, maze = _play(agent, task)
            scores.setdefault(agent.partition("=")[0], []).append((success, lengths))
            cells.append(f"{text_of(mean_interval(success, maze))} {lengths.mean():.3f}")
        if len(scores) > 1:
            first, second = (np.array(of_agent).swapaxes(0, 1) for of_agent in list(scores.values())[:2])  # [2, R, E]
            cells += [text_of(runs_interval(a, maze, b)) for a, b in zip(first, second, strict=True)]
        print(f"{name:12} {len(maze):5}", "  ".join(cells), f" ({time.perf_counter() - begin:.0f} s)", flush=True)


def _play(name: str, spec: TaskSpec) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns `outcomes` of an agent, `AGENT` or `AGENT=CHECKPOINT`."""
    name, _, checkpoint = name.partition("=")
    agent_class = load_agent_class(name)
    if spec.track is None:
        spec = dataclasses.replace(spec, context_size=agent_class.context_size(spec.size))
    spec = dataclasses.replace(spec, sensors=tuple({*spec.sensors, *agent_class.needs_sensors}))
    interface = Interface(spec.task, spec.size, spec.context_size, sensors=spec.sensors)
    agent = agent_class.build(interface, checkpoint=pathlib.Path(checkpoint) if checkpoint else None)
    return outcomes(agent, spec, agent_class.needs_truth)


def text_of(estimate: Estimate) -> str:
    """Returns a figure and its interval."""
    return f"{estimate.value:.3f} [{estimate.low:.2f}, {estimate.high:.2f}]"


if __name__ == "__main__":
    main()
