"""Evaluations on Ray: the same bytes as without, a lost task run again, and one line for what goes wrong."""

from __future__ import annotations

import os
import pathlib
import socket
from collections.abc import Iterator

import pytest
from run_folders import FEW, IMPORTS, results_of

from mazebench.errors import InputError, RunError
from mazebench.evaluation.evaluate import evaluate

pytest.importorskip("ray")
cluster = pytest.importorskip("mazebench.evaluation.cluster")

# `Mortal` drives ahead; its process dies once, and leaves a file beside the module.
AGENTS = """
import os, pathlib

class Mortal(Agent):
    def initial_state(self, batch_size):
        return 0

    def act(self, inputs, state, explore=False):
        died = pathlib.Path(__file__).with_name("died")
        if state == 30 and not died.exists():
            died.touch()
            os._exit(9)
        return np.zeros(len(inputs.seed), dtype=int), state + 1

class Wrong(Agent):
    def act(self, inputs, state, explore=False):
        return np.zeros(len(inputs.seed)), state
"""


@pytest.fixture
def unused_port() -> Iterator[int]:
    with socket.socket() as taken:  # by nobody who listens
        taken.bind(("127.0.0.1", 0))
        yield taken.getsockname()[1]


@pytest.mark.parametrize("address", ["nowhere", "127.0.0.1:{port}"])
def test_a_cluster_that_is_not_there_is_named(tmp_path, unused_port, address):
    address = address.format(port=unused_port)
    with pytest.raises(InputError, match=f"^can't reach a Ray cluster at '{address}': "):
        evaluate("random", out=tmp_path / "out", ray_address=address, **FEW)
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> pathlib.Path:
    """A folder with the agents' module, which the processes of a cluster on this machine can import."""
    folder = tmp_path_factory.mktemp("cluster")
    (folder / "cluster_at_hand.py").write_text(IMPORTS + AGENTS)
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.syspath_prepend(folder)
        monkeypatch.setenv("PYTHONPATH", str(folder))
        with cluster.Cluster("local", 0) as opened:
            assert opened.num_workers == os.cpu_count()
            yield folder


def test_ray_gives_the_same_bytes(folder, tmp_path):
    evaluate("random", out=tmp_path / "here", record=True, **FEW)
    summary = evaluate("random", out=tmp_path / "ray", record=True, workers=2, ray_address="local", **FEW)
    assert summary.overall.n == 40
    assert results_of(tmp_path / "ray") == results_of(tmp_path / "here")


def test_a_lost_task_is_run_again(folder, tmp_path):
    evaluate("cluster_at_hand:Mortal", out=tmp_path / "out", num_envs=4, workers=1, ray_address="local", **FEW)
    assert (folder / "died").exists()
    evaluate("cluster_at_hand:Mortal", out=tmp_path / "unbroken", **FEW)
    assert results_of(tmp_path / "out") == results_of(tmp_path / "unbroken")


def test_an_agents_error_is_one_line(folder):
    with pytest.raises(RunError, match=r"^agent 'cluster_at_hand:Wrong': expected 10 integer actions from act\(\), "):
        evaluate("cluster_at_hand:Wrong", workers=1, ray_address="local", **FEW)
