"""The map policy: what its network reads, what it refuses, and that the oracle teaches it."""

import numpy as np
import pytest
import torch
from mazebench_agents.map_policy import MapPolicy
from mazebench_agents.map_policy.network import MapNetwork
from simple_mazes import field

from mazebench.errors import UnplayableError
from mazebench.evaluation.chunk import run_trials
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials
from mazebench.testing import check_agent
from mazebench.training.collector import Collector

SMALL = {"num_envs": "24", "rollout_steps": "20", "minibatches": "4", "channels": "4", "hidden": "64"}


def test_a_cell_knows_what_is_as_near_as_the_steps_of_reading():
    network = MapNetwork(channels=4, steps=3, hidden=8)
    maps = torch.zeros(2, 2, 11, 11, dtype=torch.uint8)
    maps[1, 1, 5, 0] = 255  # a goal
    features = network.plan(maps).features.reshape(2, 11, 11, -1)
    differs = (features[0] != features[1]).any(-1)
    assert differs[:, :5].any(0).tolist() == [True] * 5
    assert not differs[:, 5:].any(), "a step of the first convolution, and three"


def test_agent_keeps_its_contract(tmp_path):
    learner = MapPolicy.build_learner(Task.of(mazes=field(7), sensors="egocentric"), overrides=SMALL)
    learner.save(tmp_path, {})
    check_agent(MapPolicy, task="building", sensors="egocentric", checkpoint=tmp_path / "agent.safetensors")


def test_maps_with_several_pixels_per_cell_are_refused():
    with pytest.raises(UnplayableError, match="expected maps with a pixel per cell, found 62 pixels for 31 cells"):
        MapPolicy.build_learner(Task.of("rough"))


def test_the_oracle_teaches_it():
    """In a field of 4 x 4 cells."""
    task = Task.of(mazes=field(6), distances=(2, 3, 4), time_limit=12, num_goals=1, sensors="egocentric")
    values = SMALL | {"learning_rate": "3e-3", "read_steps": "6", "epochs": "6"}
    learner = MapPolicy.build_learner(task, overrides=values)
    trials = dict(enumerate(draw_trials(task, 32, seed=7)))

    def success_rate():
        played = run_trials(learner.actor, task, trials, 64)
        return np.mean([result.success for results in played for result in results])

    before = success_rate()
    experience = Collector(task, learner.num_envs).collect(learner.actor, seed=0)
    for _ in range(4):
        for _ in range(20):
            learner.observe(next(experience))
        learner.update()
    assert before < 0.3
    assert success_rate() > 0.6
