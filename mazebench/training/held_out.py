"""The evaluation that accompanies a training run, in mazes that it doesn't train in."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.agent import Agent
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.trials import select_trials
from mazebench.maps.generators import generate
from mazebench.tasks.spec import TaskSpec

_SEED = 20_000  # of mazes that are drawn like the benchmark's, and in none of its splits
_DISTANCES = (2, 4, 6, 8, 10)
_EPISODES = 2  # for each maze and distance


class HeldOutEvaluation:
    """Episodes in `num_mazes` new mazes of the kind and size of `task_spec`'s."""

    def __init__(self, task_spec: TaskSpec, num_mazes: int):
        streams = np.random.SeedSequence([_SEED, task_spec.size]).spawn(num_mazes)
        mazes = tuple(
            generate("dfs", task_spec.size, np.random.default_rng(stream), f"held-out-{index}")
            for index, stream in enumerate(streams)
        )
        self._task_spec = dataclasses.replace(task_spec, mazes=mazes, distances=_DISTANCES, num_goals=1, pairs="random")
        self._trials = list(enumerate(select_trials("local", mazes, False, _DISTANCES, _EPISODES)))

    def success_rates(self, agent: Agent) -> dict[int, float]:
        """Returns the agent's success rate by distance in cells; it acts greedily."""
        reached: dict[int, list[bool]] = {distance: [] for distance in _DISTANCES}
        for outcomes in run_trials(agent, self._task_spec, self._trials, len(self._trials)):
            for outcome in outcomes:
                reached[outcome.trial.distance].append(outcome.success)
        return {distance: float(np.mean(successes)) for distance, successes in reached.items()}
