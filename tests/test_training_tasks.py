"""Training in a task of one's own choice: tracks, perturbations, distances; its replay and its evaluation."""

from __future__ import annotations

import itertools
import json
from typing import Any

import numpy as np
import pytest
import safetensors
from acting import RandomActor
from faults import TINY
from mazebench_agents.common.replay import Hindsight
from mazebench_agents.mah import MAH

from mazebench.errors import InputError
from mazebench.tasks.context import GLOBAL_MAP
from mazebench.tasks.task import Task
from mazebench.training.collector import Collector
from mazebench.training.held_out import HeldOutEvaluation
from mazebench.training.loop import train


def tiny_options(**changes: Any) -> dict[str, Any]:
    values = {"agent": "mah", "overrides": TINY, "checkpoint_steps": 800, "eval_mazes": 1, "env_steps": 800}
    return {**values, **changes}


def task_in(folder) -> dict[str, Any]:
    """The task that a run's config and the provenance of its checkpoint name."""
    task = json.loads((folder / "config.json").read_text())["task"]
    with safetensors.safe_open(folder / "checkpoints" / "000000000800" / "agent.safetensors", "numpy") as file:
        (metadata,) = map(json.loads, file.metadata().values())
    assert metadata["provenance"]["task"] == task
    assert len(metadata["provenance"]["agent_code_sha256"]) == 64
    return task


class Near(MAH):
    """Wants near goals."""

    @classmethod
    def task_options(cls, overrides=None) -> dict[str, Any]:
        return {"num_goals": 2, "distances": (1, 2), "time_limit": 50}


class Rewarded(Near):
    """Learns from the rewards of its steps, which this one leaves alone."""

    @classmethod
    def build_learner(cls, task, *, seed=0, overrides=None):
        return super().build_learner(task.replace(reward="sparse"), seed=seed, overrides=overrides)


def test_a_run_says_that_progress_was_rewarded(tmp_path):
    train(**tiny_options(agent=f"{__name__}:Rewarded", reward="progress"), out=tmp_path)
    task = task_in(tmp_path)
    assert (task["reward"], task["num_goals"]) == ("progress", 1)


def test_a_run_on_a_track_names_it_and_is_evaluated_on_it(tmp_path):
    train(**tiny_options(task=Task.of("rebuilt", level=(1, 2))), out=tmp_path)
    task = task_in(tmp_path)
    assert (task["task"], task["level"], task["num_goals"], task["sensors"]) == ("rebuilt", [1, 2], 1, ["lidar"])
    last = json.loads((tmp_path / "metrics.jsonl").read_text().splitlines()[-1])
    assert [name for name in last if "success" in name] == [f"success_rate_{each}" for each in (15, 21, 28, 34, 40)]


def test_the_user_chooses_before_the_learner_does(tmp_path):
    train(**tiny_options(agent=f"{__name__}:Near", distances=(3, 4)), out=tmp_path)
    task = task_in(tmp_path)
    assert (task["distances"], task["num_goals"], task["time_limit"]) == ([3, 4], 2, 50)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"minutes": 0}, "expected minutes from 0.01 to 527040, found 0"),
        ({"task": "hierarchical"}, "unknown task 'hierarchical'; available: adrift, building, doors, local"),
        ({"actions": "diff"}, "expected actions 'six' in a training, found 'diff'"),
        ({"reward": "progress"}, "agent 'mah': computes the rewards of any goal itself, found reward 'progress'"),
        ({"task": "rough"}, "agent 'mah': learns only on maps of one pixel a cell .*; found track 'rough'"),
        ({"sensors": "lidar"}, "agent 'mah': reads no sensors, found lidar"),
        ({"task": "building", "sensors": "lidar,depth"}, "agent 'mah': reads no sensors, found depth"),
        ({"look": "varied"}, "look varied: expected the sensor egocentric, found none"),
        ({"distances": 60}, "expected distances of at most "),
        ({"agent": "planner"}, "agent 'planner' doesn't learn; agents that do: dqn, mah, mah-paper, map-policy, mmn"),
        ({"overrides": {"colour": "red"}}, "unknown config key 'colour'"),
    ],
)
def test_what_can_not_be_trained_is_refused_before_a_folder_is_made(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        train(**tiny_options(**changes), out=tmp_path / "run")
    assert not list(tmp_path.iterdir())


def test_goals_are_relabelled_on_the_maps_that_were_shown():
    task = Task.of("rebuilt", split="train", kinds=("house",), num_mazes=5, size=13, distances=(3, 4))
    learner = MAH.build_learner(task, overrides=TINY)
    experience = Collector(task, learner.num_envs).collect(RandomActor(), seed=0)
    rng, shown = np.random.default_rng(0), set()
    for step in itertools.islice(experience, 150):  # more steps than an episode has
        shown |= {context[GLOBAL_MAP].tobytes() for context in step.context[step.new_episode]}
        learner.observe(step)
    sample = learner.replay.sample(200, 4, 3, hindsight=Hindsight(ratio=1.0), rng=rng)
    contexts = learner.maps.contexts(sample.contexts, 0).numpy()
    assert {context[GLOBAL_MAP].tobytes() for context in contexts} <= shown
    true = np.stack([task.mazes[maze].walls for maze in sample.contexts.maze])
    assert ((contexts[:, GLOBAL_MAP] != true).sum(axis=(1, 2)) == 2).all(), "a door closed, a door opened"


@pytest.mark.parametrize(
    ("task", "distances", "wanted"),
    [
        ({}, (), [2, 4, 6, 8, 10]),
        ({}, (1, 2, 3, 4, 12), [1, 4, 12]),
        ({"task": "building"}, (), [15, 21, 28, 34, 40]),
    ],
)
def test_held_out_goals_are_at_five_of_the_distances(task, distances, wanted):
    spec = Task.of(**task, **({"distances": distances} if distances else {}))
    evaluation = HeldOutEvaluation(spec, 2, distances)
    assert sorted({trial.distance for trial in evaluation.trials}) == wanted
