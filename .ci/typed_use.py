"""A user's script, checked by `mypy --strict` against the installed wheel.

Each `type: ignore` stands where the use is wrong. mypy complains of one without need, so types that got lost show.
"""

from __future__ import annotations

import pathlib

import gymnasium
import numpy as np

import mazebench
from mazebench.agent import Agent, Inputs
from mazebench.envs.vector import MazeVectorEnv
from mazebench.evaluation.eval_options import EvalOptions
from mazebench.testing import check_agent


class Forward(Agent):
    """An agent that drives forward."""

    def act(self, inputs: Inputs, state: None, explore: bool = False) -> tuple[np.ndarray, None]:
        return np.zeros(len(inputs.seed), dtype=int), state


class Backward(mazebench.SingleAgent):
    """An agent that drives backward, in one environment."""

    def act(self, observation: dict[str, np.ndarray]) -> int:
        return 1


class Sideways:
    """Not an agent: it subclasses none."""

    def act(self, inputs: Inputs, state: None, explore: bool = False) -> tuple[np.ndarray, None]:
        return np.full(len(inputs.seed), 2), state


def right_use() -> None:
    maze: mazebench.Maze = mazebench.generate("dfs", 15, np.random.default_rng(0))
    distance: int = maze.distance((1, 1), (13, 13))
    env = mazebench.load("local", mazes=maze, distances=[distance], seed=0)
    success: bool = env.task.success
    position: np.ndarray = env.physics.position()
    envs: MazeVectorEnv = mazebench.make_vec(mazebench.TaskOptions(task="local", size=13), 4)
    observations, infos = envs.reset(seed=[1, 2, 3, 4])
    agent: Agent = Forward()
    check_agent(Forward)
    check_agent(Backward)
    summary = mazebench.evaluate("planner", out=pathlib.Path("results"), size=13, map_flip=0.1)
    rate: float = summary.overall.success_rate
    print(success, position, observations["state"], infos, agent, rate)
    gymnasium.make("mazebench/Local-13-v1")


def wrong_use() -> None:
    mazebench.TaskOptions(size="13")  # type: ignore[arg-type]
    mazebench.TaskOptions(flip=0.1)  # type: ignore[call-arg]
    mazebench.make_vec(13, 4)  # type: ignore[arg-type]
    mazebench.generate("dfs", 15)  # type: ignore[call-arg]
    print(mazebench.make_vec("local", 4).task.sise)  # type: ignore[attr-defined]
    print(mazebench.nothing)  # type: ignore[attr-defined]
    EvalOptions(agent=Forward, task=mazebench.TaskOptions())  # type: ignore[arg-type]
    print(mazebench.evaluate("planner").overal)  # type: ignore[attr-defined]
    check_agent(Sideways)  # type: ignore[arg-type]
