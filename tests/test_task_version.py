"""Episodes of task version 1 stay what they are; `python tests/test_task_version.py` rewrites the golden file.

Whoever has to rewrite it has changed what an episode is, which docs/guarantees.md allows in a new version only.
"""

from __future__ import annotations

import json
import pathlib
from typing import Any

import gymnasium
import numpy as np
import pytest

import mazebench
from mazebench.constants import TASK_VERSION
from mazebench.envs.dm_control import Environment
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import make_plan

GOLDEN = pathlib.Path(__file__).parent / "golden" / "episodes.json"
TASKS: dict[str, dict[str, Any]] = {
    "local": {},
    "eval mazes": {"size": 21, "split": "eval"},
    "fixed pairs": {"pairs": "fixed"},
    "several goals": {"num_goals": 3, "time_limit": 4},
    "perturbed": {"map_flip": 0.1, "map_warp": 0.1, "position_noise": 0.5},
    "velocities": {"actions": "velocity"},
    "hierarchical": {"task": "hierarchical", "time_limit": 5},
}
NUM_STEPS = 12


def play(options: dict[str, Any]) -> list[dict[str, Any]]:
    """The first two episodes of seed 0, with actions that are always the same."""
    environment = mazebench.load(**options, seed=0)
    return [_episode(environment) for _ in range(2)]


def _episode(environment: Environment) -> dict[str, Any]:
    time_steps = [environment.reset()]
    task = environment.task
    while not time_steps[-1].last() and task.steps < NUM_STEPS:
        velocities = np.array([np.cos(task.steps), np.sin(task.steps), 0.5])
        time_steps.append(environment.step(velocities if task.maze_task.actions == "velocity" else task.steps**2 % 6))
    return {
        "maze": task.episode.maze,
        "seed": task.episode.seed,
        "yaw": task.episode.yaw,
        "route": task.route.cells,
        "path_length": task.path_length,
        "rewards": [time_step.reward for time_step in time_steps[1:]],
        "discounts": [time_step.discount for time_step in time_steps[1:]],
        "states": [_rounded(time_step.observation["state"]) for time_step in time_steps],
        "contexts": [_rounded(_weigh(time_step.observation["context"])) for time_step in time_steps[::6]],
    }


def _weigh(context: np.ndarray) -> np.ndarray:
    """`[4, 3]`: the sum of each plane, and those weighted by row and by column."""
    index = np.arange(context.shape[-1])
    return np.stack([context.sum((1, 2)), context.sum(2) @ index, context.sum(1) @ index], axis=1)


def _rounded(values: np.ndarray) -> list[Any]:
    return np.round(values.astype(float), 5).tolist()


@pytest.mark.parametrize("name", TASKS)
def test_episodes_when_compared_with_golden_ones(name):
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))[name]
    for found, expected in zip(play(TASKS[name]), golden, strict=True):
        assert found.keys() == expected.keys()
        for key in expected:
            np.testing.assert_allclose(found[key], expected[key], rtol=1e-6, atol=1e-4, err_msg=key)


def test_version_when_environments_are_asked():
    assert gymnasium.make("mazebench/Local-13-v1").spec.version == TASK_VERSION
    assert gymnasium.make("mazebench/Building-v1").spec.version == TASK_VERSION


@pytest.mark.parametrize("name", ["local", "building"])
def test_version_when_a_result_says_what_it_came_from(name):
    assert make_plan(eval_options("random", name)).provenance.task_version == TASK_VERSION


if __name__ == "__main__":
    lines = (f"{json.dumps(name)}: {json.dumps(play(options))}" for name, options in TASKS.items())
    GOLDEN.write_text("{" + ",\n".join(lines) + "}\n", encoding="utf-8")
