"""Runs on a Ray cluster of two nodes: the same bytes, also if one of them is killed in the middle."""

from __future__ import annotations

import contextlib
import os
import pathlib
import signal
import socket
import threading
import time

import pytest
from faults import TINY, descendants
from run_folders import FEW, IMPORTS, results_of

from mazebench.evaluation.eval_options import RunOptions
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.ray_cluster import RayExecutor
from mazebench.evaluation.suites import SUITES, Part, run_suite
from mazebench.tasks.task_options import TaskOptions
from mazebench.training.loop import train
from mazebench.training.seeds import train_seeds
from mazebench.training.train_options import TrainOptions

pytest.importorskip("ray")
from ray.cluster_utils import Cluster

NODE = {"include_dashboard": False, "object_store_memory": 80 * 2**20}
PARTS = tuple(Part(f"near-{size}", TaskOptions(size=size, distances=(1, 2)), 1) for size in (13, 15))
# The first process that comes to the fifth step of a chunk kills its parent, which is the node, and itself.
MORTAL = """
import os, pathlib, signal

class Mortal(Agent):
    def initial_state(self, batch_size):
        with pathlib.Path(__file__).with_name("chunks").open("a") as file:
            file.write("x")
        return 0

    def act(self, inputs, state, explore=False):
        armed = pathlib.Path(__file__).with_name("armed")
        if state == 5 and armed.exists():
            armed.unlink()
            for process in (os.getppid(), os.getpid()):
                os.kill(process, signal.SIGKILL)
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
    pathlib.Path("chunks").unlink()
    pathlib.Path("armed").touch()
    evaluate("mortal_at_hand:Mortal", out="there", cluster="ray", record=True, **FEW)
    assert pathlib.Path("chunks").read_text() == "xxx"  # two, of which one was run again
    assert results_of(tmp_path / "there") == results_of(tmp_path / "here")


def test_a_suite_has_the_same_bytes_from_outside_of_the_cluster(tmp_path, cluster, nodes):
    run_suite("few", ["planner", "random"], tmp_path / "here")
    run_suite("few", ["planner", "random"], tmp_path / "there", RunOptions(cluster=cluster.client))
    assert results_of(tmp_path / "there") == results_of(tmp_path / "here")


def test_trainings_go_on_where_a_node_was_killed(tmp_path, cluster, nodes):
    values = {"agent": "mah", "checkpoint_steps": 800, "checkpoint_minutes": 0, "eval_mazes": 1, "env_steps": 2400}
    options = TrainOptions(overrides=TINY, **values)
    folders = {seed: tmp_path / "there" / str(seed) for seed in (0, 1)}

    def kill_the_node_of_the_first() -> None:
        """Kills the node whose training is the first to reach a milestone; a file is named after its process."""
        while not (begun := [path for folder in folders.values() for path in folder.glob("tensorboard/*")]):
            time.sleep(0.05)
        process = int(begun[0].suffix[1:])
        processes = {node: descendants(node.all_processes["raylet"][0].process.pid) for node in nodes}
        node = next(node for node in nodes if process in processes[node])
        nodes.remove(node)
        cluster.remove_node(node, allow_graceful=False)
        for each in processes[node]:  # which a node that loses its power would not leave
            with contextlib.suppress(ProcessLookupError):
                os.kill(each, signal.SIGKILL)

    thread = threading.Thread(target=kill_the_node_of_the_first)
    thread.start()
    with RayExecutor("ray") as executor:
        train_seeds(options, TaskOptions(), folders, executor=executor)
    thread.join()
    began = [len(list(folder.glob("tensorboard/*"))) for folder in folders.values()]
    assert sorted(began) == [1, 2]
    for seed, folder in folders.items():
        train(out=tmp_path / "here" / str(seed), seed=seed, overrides=TINY, **values)
        for name in ("metrics.jsonl", "checkpoints/000000002400/agent.safetensors"):
            assert (folder / name).read_bytes() == (tmp_path / "here" / str(seed) / name).read_bytes()
