"""Runs on other people's executors: the same bytes, whole evaluations where there are enough, and what is refused."""

from __future__ import annotations

import concurrent.futures
import multiprocessing
import pathlib
from importlib import metadata

import pytest
from run_folders import FEW, IMPORTS, records_of, results_of

from mazebench.errors import InputError, RunError
from mazebench.evaluation.eval_options import EvalOptions, RunOptions
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.suites import SUITES, Part, run_suite
from mazebench.tasks.task_options import TaskOptions
from mazebench.training.loop import train
from mazebench.training.run_folder import checkpoints
from mazebench.training.seeds import train_seeds
from mazebench.training.train_options import TrainOptions

SPAWN = multiprocessing.get_context("spawn")
PARTS = tuple(Part(f"near-{size}", TaskOptions(size=size, distances=(1, 2)), 1) for size in (13, 15))
TRAINING = {"agent": "mah", "env_steps": 400, "checkpoint_steps": 400, "eval_mazes": 1, "overrides": {"hidden": 16}}


@pytest.fixture(scope="module")
def two_processes():
    with concurrent.futures.ProcessPoolExecutor(2, SPAWN) as executor:
        yield executor


@pytest.fixture
def _few(monkeypatch):
    monkeypatch.setitem(SUITES, "few", PARTS)


class Here(concurrent.futures.ThreadPoolExecutor):
    """Runs chunks one at a time in this process, and keeps their sizes."""

    def __init__(self):
        super().__init__(1)
        self.sizes = []

    def submit(self, function, packed, chunk):
        self.sizes.append((len(chunk.numbers), chunk.num_envs))
        return super().submit(function, packed, chunk)


class Losing(Here):
    """Loses the third chunk and those after it, as an engine whose nodes are gone."""

    def submit(self, function, packed, chunk):
        return super().submit(function if len(self.sizes) < 2 else _lose, packed, chunk)


def _lose(packed, chunk):
    raise ConnectionError("node 7 is gone\nas it seems")


@pytest.mark.usefixtures("_few")
def test_a_suite_has_the_same_bytes(tmp_path, two_processes):
    run_suite("few", ["planner", "random"], tmp_path / "here")
    run_suite("few", ["planner", "random"], tmp_path / "there", RunOptions(workers=2), executor=two_processes)
    assert results_of(tmp_path / "there") == results_of(tmp_path / "here")


def test_demonstrations_are_the_same(tmp_path, two_processes):
    minari = pytest.importorskip("minari")
    from mazebench.evaluation.collect import collect_demonstrations

    options = EvalOptions(agent="random", task=TaskOptions(split="train", time_limit=9), seed=3)
    for name, run, executor in (("here", RunOptions(), None), ("there", RunOptions(workers=2), two_processes)):
        collect_demonstrations(options, 9, tmp_path / name, run=run, executor=executor)
    here, there = (list(minari.MinariDataset(tmp_path / name)) for name in ("here", "there"))
    assert [episode.actions.tolist() for episode in there] == [episode.actions.tolist() for episode in here]


def test_trainings_of_several_seeds_are_those_of_single_ones(tmp_path, two_processes):
    folders = {seed: tmp_path / f"of-{seed}" for seed in (0, 1)}
    train_seeds(TrainOptions(**TRAINING), TaskOptions(), folders, executor=two_processes)
    for seed, folder in folders.items():
        train(out=tmp_path / "alone" / str(seed), seed=seed, **TRAINING)
        last = [checkpoints(each)[-1] / "agent.safetensors" for each in (folder, tmp_path / "alone" / str(seed))]
        assert last[0].read_bytes() == last[1].read_bytes()
    with pytest.raises(InputError, match="of-0: holds a run already; go on with --resume"):
        train_seeds(TrainOptions(**TRAINING), TaskOptions(), folders, executor=two_processes)
    with pytest.raises(InputError, match="expected --env-steps and no --minutes with --seeds"):
        train_seeds(TrainOptions(agent="mah", minutes=1), TaskOptions(), folders)


@pytest.mark.usefixtures("_few")
def test_whole_evaluations_are_handed_out_where_there_are_enough_and_chunks_else(tmp_path):
    executor = Here()
    run_suite("few", ["random", "planner"], tmp_path / "suite", RunOptions(workers=1), executor=executor)
    evaluate("random", workers=8, executor=executor, **FEW)
    evaluate("random", workers=100, executor=executor, **FEW)
    assert executor.sizes == [(40, 40)] * 4 + [(5, 5)] * 8 + [(4, 4)] * 10


def test_a_chunk_that_an_engine_loses_is_named_and_the_others_are_kept(tmp_path):
    run = {"out": tmp_path / "run", "workers": 4, **FEW}
    said = "^the executor lost a chunk: ConnectionError: node 7 is gone as it seems; what ended is kept, go on with --r"
    with pytest.raises(RunError, match=said):
        evaluate("random", executor=Losing(), **run)
    calls = []
    evaluate("random", executor=Here(), resume=True, progress=lambda *call: calls.append(call), **run)
    assert calls[0] == (20, 40)
    evaluate("random", out=tmp_path / "unbroken", **FEW)
    assert records_of(tmp_path / "run") == records_of(tmp_path / "unbroken")


def _other_numpy():
    version = metadata.version
    metadata.version = lambda name: "0.1" if name == "numpy" else version(name)


def _other_agent(file):
    pathlib.Path(file).write_text(AGENT.replace("= 1", "= 2"))


AGENT = IMPORTS + "class Forward(SingleAgent):\n    CHANGED = 1\n    def act(self, observation):\n        return 0\n"


def test_a_node_of_other_versions_or_code_is_refused_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    file = tmp_path / "forward_at_hand.py"
    file.write_text(AGENT)
    for agent, initializer, words, said in (
        ("random", _other_numpy, (), r"numpy \S+, as where the run began, found 0\.1$"),
        ("forward_at_hand:Forward", _other_agent, (file,), "code of agent 'forward_at_hand:Forward' "),
    ):
        with (
            concurrent.futures.ProcessPoolExecutor(1, SPAWN, initializer, words) as executor,
            pytest.raises(InputError, match=rf"^node \S+: expected {said}"),
        ):
            evaluate(agent, executor=executor, workers=1, **FEW)


def test_what_can_not_be_spread_is_refused(tmp_path):
    person = {"model": "person:someone"}
    for agent, options, said in (
        ("random", {"executor": Here()}, "expected workers with an executor"),
        ("llm-bfs", {"executor": Here(), "workers": 1}, "agent 'llm-bfs': expected one machine, found a cluster"),
        ("llm", {"cluster": "ray", "overrides": person}, "agent 'llm': expected one machine, found a cluster"),
        ("random", {"cluster": "dask://x"}, "expected --cluster ray or ray://HOST:PORT, found 'dask://x'"),
    ):
        with pytest.raises(InputError, match=said):
            evaluate(agent, out=tmp_path / "run", **options, **FEW)
    assert not (tmp_path / "run").exists()


def test_without_ray_a_line_says_what_brings_it(command, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "ray", None)
    for words in (["eval", "--agent", "random"], ["train", "--agent", "mah", "--seeds", "0-1", "--env-steps", "9"]):
        status, _, errors = command(*words, "--cluster", "ray")
        assert (status, errors) == (2, "mazebench: --cluster needs Ray, which the extra [ray] brings (docs/scale.md)\n")


def test_dask_is_an_executor(tmp_path):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        evaluate("planner", out=tmp_path / "there", executor=client.get_executor(), workers=2, record=True, **FEW)
    evaluate("planner", out=tmp_path / "here", record=True, **FEW)
    assert results_of(tmp_path / "there") == results_of(tmp_path / "here")
