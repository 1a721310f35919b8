"""The learning test of all learners: what a minute of training in an open field brings."""

from __future__ import annotations

from typing import Any

import numpy as np
from simple_mazes import field

from mazebench.evaluation.chunk import run_trials
from mazebench.maps.maze import Maze
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials
from mazebench.training.collector import Collector
from mazebench.training.loop import num_updates_due

TIME_LIMIT = 25


def learn(
    agent_class: Any, side: int, distances: tuple[int, ...], num_updates: int, values: dict[str, Any]
) -> tuple[float, float]:
    """Success rates before and after so many updates, in a field of `side` x `side` cells with walls around."""
    maze = field(side + 2)
    spec = Task.of(mazes=maze, distances=distances, time_limit=TIME_LIMIT, num_goals=4)
    overrides = {key: str(value) for key, value in values.items()}
    learner = agent_class.build_learner(spec, overrides=overrides)
    before = _success_rate(learner.actor, maze, distances)
    experience = Collector(spec, learner.num_envs).collect(learner.actor, seed=0)
    steps = updates = 0
    while updates < num_updates:
        learner.observe(next(experience))
        steps += learner.num_envs
        while updates < num_updates_due(learner, steps):
            learner.update()
            updates += 1
    return before, _success_rate(learner.actor, maze, distances)


def _success_rate(actor: Any, maze: Maze, distances: tuple[int, ...]) -> float:
    """Of acting greedily, over 32 episodes a distance."""
    spec = Task.of(mazes=maze, distances=distances, time_limit=TIME_LIMIT)
    trials = dict(enumerate(draw_trials(spec, 32, seed=7)))
    return np.mean([result.success for results in run_trials(actor, spec, trials, 64) for result in results])
