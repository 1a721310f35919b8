"""Labels of the expert: what the oracle would do, from the true state alone."""

from __future__ import annotations

import numpy as np
import pytest
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from mazebench_agents.expert import Expert, labels
from mazebench_agents.robot.moving_body import BACKWARD, FORWARD, LOOK_LEFT
from simple_mazes import corridor

import mazebench
from mazebench.constants import NUM_ACTIONS
from mazebench.errors import InputError
from mazebench.evaluation.measured_oracle import measure_oracle_steps
from mazebench.tasks.trials import Trial
from mazebench.world.bodies import SLIDER

NUM_ENVS = 8


@pytest.fixture
def envs():
    envs = mazebench.make_vec("building", NUM_ENVS, kinds=("dfs", "house", "rooms"), fresh=True)
    envs.reset(seed=0)
    yield envs
    envs.close()


def test_drives_by_the_labels_are_about_as_quick_as_the_oracles(envs):
    trials = [Trial(episode, distance=0, shortest_path=0) for episode in envs.episodes]
    steps = np.zeros(NUM_ENVS, dtype=int)
    while not steps.all():
        *_, terminated, truncated, info = envs.step(labels(envs))
        assert not truncated.any()
        first = terminated & (steps == 0)
        if first.any():
            steps[first] = info["final_info"]["steps"][first]
    assert steps.sum() < 1.05 * sum(measure_oracle_steps(envs.task, trials))


@pytest.mark.parametrize(
    ("task", "options"),
    [("rebuilt", {"distances": (15,)}), ("hierarchical", {"landmark_distance": 2})],
)
def test_labels_follow_from_the_state_whoever_has_driven_to_it(task, options):
    envs = mazebench.make_vec(task, NUM_ENVS, **options)
    envs.reset(seed=0)
    rng, goals = np.random.default_rng(0), set()
    for step in range(80):
        found, rules = labels(envs), envs.rules
        if step % 10 == 0:
            new = Expert(envs.task.mazes, NUM_ENVS, SLIDER)
            costs = new.costs(rules.maze, rules.target, rules.pose, envs.velocity())
            np.testing.assert_array_equal(found, costs.argmin(axis=1))
            np.testing.assert_array_equal(labels(envs, costs=True), costs)
        goals |= set(zip(rules.maze.tolist(), rules.target.tolist(), strict=True))
        is_random = np.arange(NUM_ENVS) % 2 == 0
        envs.step(np.where(is_random, rng.integers(NUM_ACTIONS, size=NUM_ENVS), found))
    assert len(goals) > NUM_ENVS  # also of episodes and legs that follow
    envs.close()


def test_costs_are_metres_of_way():
    expert = Expert((corridor(),), 2, SLIDER)
    # At rest far from the goal, which is ahead; and in front of the goal, at 1 m/s.
    pose = np.array([[2.5, 7.5, 0.0], [6.95, 7.5, 0.0]])
    at_rest, at_goal = expert.costs(np.zeros(2, int), np.full(2, 9 + 7), pose, np.array([[0.0, 0.0], [1.0, 0.0]]))
    assert at_rest.argmin() == at_goal.argmin() == FORWARD
    way = 7 - 2.5
    assert 0 < at_rest[FORWARD] < at_rest[LOOK_LEFT] < at_rest[BACKWARD] < way + 1
    assert at_goal[FORWARD] < 0


def test_other_environments_are_refused(envs):
    wrapped = RecordEpisodeStatistics(envs)
    np.testing.assert_array_equal(labels(wrapped), labels(envs))
    with pytest.raises(InputError, match=r"expected environments of mazebench\.make_vec, found MazeEnv"):
        labels(mazebench.make("building"))
    with pytest.raises(InputError, match="expected environments with actions 'six', found 'four'"):
        labels(mazebench.make_vec("local", 2, actions="four"))
    with pytest.raises(InputError, match=r"expected a call to reset\(\) before that of labels\(\)"):
        labels(mazebench.make_vec("building", 2))
