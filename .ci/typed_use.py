"""A user's script, checked by `mypy --strict` against the installed wheel.

Each `type: ignore` stands where the use is wrong. mypy complains of one without need, so types that got lost show.
"""

from __future__ import annotations

import pathlib

import gymnasium
import numpy as np

import mazebench
from mazebench.agent import Agent, Interface, Observation
from mazebench.envs.vector import MazeVectorEnv
from mazebench.evaluation.harness import evaluate
from mazebench.evaluation.options import EvalOptions
from mazebench.testing import check_agent


class Forward:
    """An agent that drives forward."""

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Forward:
        return cls()

    def initial_state(self, batch_size: int) -> None:
        return None

    def act(
        self, observation: Observation, is_first: np.ndarray, state: None, explore: bool = False
    ) -> tuple[np.ndarray, None]:
        return np.zeros(len(is_first), dtype=int), state


class Sideways:
    """Not an agent: it has no `act`."""

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Sideways:
        return cls()


def right_use() -> None:
    maze: mazebench.Maze = mazebench.generate("dfs", 15, np.random.default_rng(0))
    cells: list[tuple[int, int]] = maze.shortest_path((1, 1), (13, 13))
    env = mazebench.load("local", maps=maze, distances=[len(cells) - 1], seed=0)
    success: bool = env.task.success
    position: np.ndarray = env.physics.position()
    envs: MazeVectorEnv = mazebench.make_vec("local", 4, size=13)
    observations, infos = envs.reset(seed=[1, 2, 3, 4])
    agent: Agent = Forward()
    check_agent(Forward)
    summary = evaluate(EvalOptions("planner", size=13), pathlib.Path("results"))
    print(success, position, observations["state"], infos, agent, summary["overall"])
    gymnasium.make("mazebench/Local-13-v1")


def wrong_use() -> None:
    mazebench.load("local", size="13")  # type: ignore[arg-type]
    mazebench.make_spec("local", flip=0.1)  # type: ignore[call-arg]
    mazebench.generate("dfs", 15)  # type: ignore[call-arg]
    print(mazebench.make_vec("local", 4).task_spec.sise)  # type: ignore[attr-defined]
    print(mazebench.nothing)  # type: ignore[attr-defined]
    EvalOptions(agent=Forward)  # type: ignore[arg-type]
    check_agent(Sideways)  # type: ignore[arg-type]
