"""Runs on a Ray cluster of two nodes: the same bytes, also if one of them is killed in the middle."""

from __future__ import annotations

import pathlib
import socket
import threading
import time

import pytest
from faults import TINY
from run_folders import FEW, IMPORTS, results_of

from mazebench.evaluation.eval_options import RunOptions
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.ray_cluster import RayExecutor
from mazebench.evaluation.suites import SUITES, Part, run_suite
from mazebench.tasks.task_options import TaskOptions
from mazebench.training.loop import train
from mazebench.training.run_folder import checkpoints
from mazebench.training.seeds import train_seeds
from mazebench.training.train_options import TrainOptions

pytest.importorskip("ray")
from ray.cluster_utils import Cluster

NODE = {"include_dashboard": False, "object_store_memory": 80 * 2**20}
PARTS = tuple(Part(f"near-{size}", TaskOptions(size=size, distances=(1, 2)), 1) for size in (13, 15))
# Once, the first process that comes to the fifth step of a chunk kills its parent, which is the node.
MORTAL = """
import os, pathlib, signal, time

class Mortal(Agent):
    def initial_state(self, batch_size):
        return 0

    def act(self, inputs, state, explore=False):
        killed = pathlib.Path(__file__).with_name("killed")
        if state == 5 and killed.parent.joinpath("armed").exists() and not killed.exists():
            killed.touch()
            os.kill(os.getppid(), signal.SIGKILL)
            time.sleep(60)
        return np.zeros(len(inputs.seed), dtype=int), state + 1
"""


@pytest.fixture(scope="module")
def cluster():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        port = found.getsockname()[1]
    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "ray_client_server_port": port, **NODE})
    cluster.client = f"ray://127.0.0.1:{port}"
    yield cluster
    cluster.shutdown()


@pytest.fixture
def nodes(cluster, monkeypatch):
    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    monkeypatch.setitem(SUITES, "few", PARTS)
    nodes = [cluster.add_node(num_cpus=1, **NODE) for _ in range(2)]
    yield nodes
    for node in nodes:
        cluster.remove_node(node)


def test_an_evaluation_has_the_same_bytes_though_a_node_is_killed(tmp_path, monkeypatch, nodes):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    pathlib.Path("mortal_at_hand.py").write_text(IMPORTS + MORTAL)
    evaluate("mortal_at_hand:Mortal", out="here", record=True, **FEW)
    pathlib.Path("armed").touch()
    evaluate("mortal_at_hand:Mortal", out="there", cluster="ray", record=True, **FEW)
    assert pathlib.Path("killed").exists()
    assert results_of(tmp_path / "there") == results_of(tmp_path / "here")


def test_a_suite_has_the_same_bytes_from_outside_of_the_cluster(tmp_path, cluster, nodes):
    run_suite("few", ["planner", "random"], tmp_path / "here")
    run_suite("few", ["planner", "random"], tmp_path / "there", RunOptions(cluster=cluster.client))
    assert results_of(tmp_path / "there") == results_of(tmp_path / "here")


def test_trainings_go_on_where_a_node_was_killed(tmp_path, cluster, nodes):
    values = {"agent": "mah", "checkpoint_steps": 800, "checkpoint_minutes": 0, "eval_mazes": 1, "env_steps": 2400}
    options = TrainOptions(overrides=TINY, **values)
    folders = {seed: tmp_path / "there" / str(seed) for seed in (0, 1)}

    def kill_a_node() -> None:
        while not all(len(checkpoints(folder)) > 1 for folder in folders.values()):
            time.sleep(0.05)
        cluster.remove_node(nodes.pop(), allow_graceful=False)

    thread = threading.Thread(target=kill_a_node)
    thread.start()
    with RayExecutor("ray") as executor:
        train_seeds(options, TaskOptions(), folders, executor=executor)
    thread.join()
    assert len(nodes) == 1
    for seed, folder in folders.items():
        train(out=tmp_path / "here" / str(seed), seed=seed, overrides=TINY, **values)
        for name in ("metrics.jsonl", "checkpoints/000000002400/agent.safetensors"):
            assert (folder / name).read_bytes() == (tmp_path / "here" / str(seed) / name).read_bytes()
