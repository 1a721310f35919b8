"""Draws what the neural planner knows, pays and plans in an episode: `python benchmarks/planner_picture.py`.

The picture is docs/images/neural-planner.png. The episode is in a train maze of the track `rebuilt`.
"""

from __future__ import annotations

import pathlib

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mazebench_agents.neural_planner import NeuralPlanner
from mazebench_agents.neural_planner.network import Plan

from mazebench.agent import Inputs
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.benchmark import load_kind_mazes
from mazebench.tasks.task import Task

PATH = pathlib.Path(__file__).parent.parent / "docs" / "images" / "neural-planner.png"
HOUSE = 17  # index of the train maze
SEED = 4  # of the episode
SHARE = 0.55  # of the episode's steps after which it is drawn


def main() -> None:
    """Draws the picture."""
    steps = play()
    pose, grid, plan = steps[int(SHARE * len(steps))]
    driven = np.array([each for each, *_ in steps[: int(SHARE * len(steps)) + 1]])
    size = grid.shape[-1]
    prior, walls, _, unlikely = grid
    row, column = np.unravel_index(unlikely.argmin(), unlikely.shape)
    panels = {
        "shown: the map, before doors moved": (prior / 255, "Greys"),
        "known: the map and what was seen": (walls / 255, "Greys"),
        "learned: the cost of each cell (log)": (np.log(plan.cost.numpy()), "viridis"),
        "planned: the way to the goal": (np.minimum(plan.way.numpy(), 90), "viridis_r"),
    }
    figure = Figure(figsize=(9.6, 2.7), layout="constrained")
    for axes, (title, (picture, colours)) in zip(figure.subplots(1, 4), panels.items(), strict=True):
        _show(axes, picture, colours, title)
        axes.plot(driven[:, 0] - 0.5, size - driven[:, 1] - 0.5, color="#d1495b", linewidth=1.4)
        axes.plot(pose[0] - 0.5, size - pose[1] - 0.5, "o", color="#d1495b", markersize=4)
        axes.plot(column, row, "*", color="#2a9d3a", markersize=9)
    figure.savefig(PATH, dpi=150, metadata={"Software": None})
    print(PATH)


def play() -> list[tuple[np.ndarray, np.ndarray, Plan]]:
    """Returns before each step of an episode the pose, and the grid and the plan that the robot has."""
    task = Task.of("rebuilt", level=2, split="train", distances=35)
    task = task.in_mazes([load_kind_mazes("train")[HOUSE]])
    agent = NeuralPlanner.build(task.interface)
    envs, state = MazeVectorEnv(task, 1), agent.initial_state(1)
    observation, info = envs.reset(seed=SEED)
    steps, new = [], np.ones(1, dtype=bool)
    while True:
        pose = np.array([*info["position"][0], info["yaw"][0]])
        actions, state = agent.act(Inputs(observation, new, new, np.zeros(1, np.int64)), state)
        [robot] = state.robots
        steps.append((pose, robot.grid, robot.plan))
        observation, _, terminated, truncated, info = envs.step(actions)
        new = terminated | truncated
        if new.any():
            return steps


def _show(axes: Axes, picture: np.ndarray, colours: str, title: str) -> None:
    axes.imshow(picture, cmap=colours, interpolation="nearest")
    axes.set_title(title, fontsize=7.5)
    axes.set_axis_off()


if __name__ == "__main__":
    main()
