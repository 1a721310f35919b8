"""Evaluations on Ray: the same bytes as without, a lost task run again, and one line for what goes wrong."""

from __future__ import annotations

import os
import pathlib

import pytest

from mazebench.errors import InputError, RunError
from mazebench.evaluation.harness import EvalOptions, Evaluation, evaluate, run_evaluations
from mazebench.evaluation.trajectories import TRAJECTORIES

pytest.importorskip("ray")

OPTIONS = EvalOptions("random", distances=(1, 3), episodes_per_distance=1)
# Drives ahead; its process dies once, and says so in a file.
MORTAL = """
import os, pathlib
import numpy as np

class Mortal:
    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        return cls()

    def initial_state(self, batch_size):
        return 0

    def act(self, observation, is_first, state, explore=False):
        died = pathlib.Path(__file__).with_name("died")
        if state == 30 and not died.exists():
            died.touch()
            os._exit(9)
        return np.zeros(len(is_first), dtype=int), state + 1

class Wrong(Mortal):
    def act(self, observation, is_first, state, explore=False):
        return np.zeros(len(is_first)), state
"""


@pytest.fixture
def _agents_at_hand(tmp_path, monkeypatch):
    (tmp_path / "cluster_at_hand.py").write_text(MORTAL)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))  # for Ray's processes


def test_bytes_when_run_on_ray(tmp_path):
    evaluate(OPTIONS, tmp_path / "here", record=True)
    summary = evaluate(OPTIONS, tmp_path / "ray", record=True, workers=2, ray_address="local")
    assert summary["overall"]["n"] == 40
    for name in ("episodes.jsonl", TRAJECTORIES):
        assert (tmp_path / "ray" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()


@pytest.mark.usefixtures("_agents_at_hand")
def test_task_when_its_process_dies_or_agent_fails(tmp_path, capfd):
    from mazebench.evaluation.cluster import Cluster

    with Cluster("local") as cluster:
        assert cluster.num_cpus == os.cpu_count()
        # Both within the cluster that runs already.
        options = EvalOptions("cluster_at_hand:Mortal", distances=(1, 2), episodes_per_distance=1)
        evaluations = [Evaluation(options, tmp_path / "out")]
        run_evaluations(evaluations, resume=False, num_envs=4, workers=1, ray_address="local")
        assert (tmp_path / "died").exists()
        assert "a Ray task was lost; it is run again" in capfd.readouterr().err
        evaluate(options, tmp_path / "unbroken")
        episodes = [pathlib.Path(tmp_path, name, "episodes.jsonl").read_bytes() for name in ("out", "unbroken")]
        assert episodes[0] == episodes[1]
        wrong = EvalOptions("cluster_at_hand:Wrong", distances=(1,), episodes_per_distance=1)
        with pytest.raises(RunError, match=r"^agent 'cluster_at_hand:Wrong': expected act\(\) to return integer act"):
            evaluate(wrong, tmp_path / "wrong", workers=1, ray_address="local")


def test_cluster_when_address_is_wrong(tmp_path):
    with pytest.raises(InputError, match="can't reach a Ray cluster at 'nowhere'"):
        evaluate(OPTIONS, tmp_path / "out", ray_address="nowhere")
    assert list(tmp_path.iterdir()) == []
