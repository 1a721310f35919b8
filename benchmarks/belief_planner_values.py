"""Prints from which distances a training run of belief-planner has learned, and its values by distance.

Call it as `python benchmarks/belief_planner_values.py RUN`.
"""

from __future__ import annotations

import json
import pathlib
import sys

import numpy as np
import torch
from mazebench_agents.belief_planner import BeliefPlanner
from mazebench_agents.belief_planner.learner import BeliefPlannerLearner
from mazebench_agents.belief_planner.network import BeliefPlannerNetwork
from mazebench_agents.belief_planner.wrong_maps import planes_of

from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.build import make_spec
from mazebench.training.run_folder import RunFolder

_NUM_BATCHES = 150
_NUM_MAZES = 30  # held out, of the same generator
_MAZE_SEED = 777
_FARTHEST = 20  # cells; values of farther ones are not printed


def distances_learned_from(
    learner: BeliefPlannerLearner, mazes: tuple[Maze, ...], num_batches: int = _NUM_BATCHES
) -> np.ndarray:
    """Returns the distances `[n]` int, in cells, of the states of some batches from their goals, real or relabelled."""
    size, config = mazes[0].size, learner.actor.config
    fields: dict[tuple[int, int], np.ndarray] = {}
    found = []
    for _ in range(num_batches):
        sample = learner.replay.sample_sequences(
            config.groups, config.sequences, config.sequence_steps, hindsight=learner.hindsight, rng=learner.rng
        )
        for key, cells, exists in zip(
            zip(sample.maze.tolist(), sample.goal.tolist(), strict=True), sample.cell, sample.exists, strict=True
        ):
            if key not in fields:
                fields[key] = mazes[key[0]].distances(divmod(key[1], size)).ravel()
            found.append(fields[key][cells[exists]])
    return np.concatenate(found)


@torch.no_grad()
def values_by_distance(
    network: BeliefPlannerNetwork, mazes: tuple[Maze, ...], rng: np.random.Generator
) -> dict[int, np.ndarray]:
    """Returns values and learned distances `[n, 2]`, by true distance in cells.

    They are of bodies at rest in all cells, with one goal a maze.
    """
    found: dict[int, list[tuple[float, float]]] = {}
    for maze in mazes:
        free = np.argwhere(~maze.walls)
        goal = tuple(free[rng.integers(len(free))].tolist())
        exact = torch.from_numpy(planes_of(maze.walls, goal))
        anchors = torch.from_numpy(free).float()
        code = network.hypermodel(exact.expand(len(free), -1, -1, -1), anchors)
        features = torch.zeros(len(free), 1, 9)
        features[..., 3] = 1.0  # the cosine of yaw
        latent = network.encode(features)
        value = network.value(network.predict(latent, network.look(latent, code), code).value_logits)[:, 0]
        far = maze.distances(goal)
        for (row, column), cell_value in zip(free.tolist(), value.tolist(), strict=True):
            learned = float(code.distance[0, :, row, column].mean())
            found.setdefault(int(far[row, column]), []).append((cell_value, learned))
    return {distance: np.array(found[distance]) for distance in sorted(found)}


def main(folder: pathlib.Path) -> None:
    """Prints both for the last checkpoint in the run folder `folder`."""
    config = json.loads((folder / "config.json").read_text(encoding="utf-8"))
    task = make_spec("local", config["size"], context_size=config["size"])
    overrides = {name: str(value) for name, value in config["agent_config"].items()}
    learner = BeliefPlanner.build_learner(task, overrides=overrides)
    with RunFolder(folder) as run:
        learner.load(run.checkpoints()[-1])
    shown = distances_learned_from(learner, task.mazes)
    print("states learned from that lie farther from their goal than")
    for distance in (5, 8, 10, 12, 15):
        print(f"  {distance:2d} cells: {(shown > distance).mean():.2%}")
    print(f"  farthest: {shown.max()} cells")
    rng = np.random.default_rng(_MAZE_SEED)
    held_out = tuple(generate("dfs", config["size"], rng, f"held-out-{index}") for index in range(_NUM_MAZES))
    print("value and learned distance, in steps, by cells from the goal, in held-out mazes")
    for distance, values in values_by_distance(learner.actor.network, held_out, rng).items():
        if distance > _FARTHEST:
            break
        print(f"  {distance:2d}: {values[:, 0].mean():6.1f} {values[:, 1].mean():6.1f}")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
