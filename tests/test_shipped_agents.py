"""The trained agents that ship: they load, and do what their page says, far from it at least not."""

import json

import pytest
from mazebench_agents.common.checkpoint import load_checkpoint

from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.evaluate import evaluate

SHIPPED = ("mmn", "mmn-paths", "mah", "mah-paper", "dqn", "neural-planner", "neural-mapper")


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_checkpoint_has_its_config_and_curve_beside_it(name):
    path = load_agent_class(name).default_checkpoint()
    _, metadata = load_checkpoint(path, name)
    config = json.loads(path.with_suffix(".config.json").read_text())
    curve = [json.loads(line) for line in path.with_suffix(".metrics.jsonl").read_text().splitlines()]
    assert metadata["config"] == config["agent_config"]
    assert metadata["provenance"]["env_steps"] == curve[-1]["env_steps"]


@pytest.mark.parametrize("name", ["mmn", "mah"])
def test_shipped_agent_with_a_map_reaches_near_goals_in_its_training_mazes(tmp_path, name):
    summary = evaluate(name, out=tmp_path / name, split="train", distances=(2, 4), episodes_per_distance=2)
    assert summary.overall.success_rate > 0.9


def test_shipped_neural_planner_reaches_goals_of_a_track(tmp_path):
    parts = {"task": "rebuilt", "split": "train", "distances": (15,), "kinds": ("house",)}
    summary = evaluate("neural-planner", out=tmp_path / "run", **parts)
    assert summary.overall.success_rate > 0.8


def test_shipped_dqn_without_a_map_does_not(tmp_path):
    summary = evaluate("dqn", out=tmp_path / "dqn", split="train", distances=(4,), episodes_per_distance=2)
    assert summary.overall.success_rate < 0.6
