"""The training loop: run folders, resuming, faults, and collecting on Ray."""

import dataclasses
import itertools
import json
import math
import time

import numpy as np
import pytest
from faults import TINY

from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.tasks.spec import TaskSpec
from mazebench.training.experience import Collector
from mazebench.training.loop import TrainingError, TrainOptions, train
from mazebench.training.run_folder import RunFolder


def tiny_options(**changes):
    values = {"agent": "mah", "overrides": tuple(TINY.items()), "checkpoint_steps": 800, "eval_mazes": 1}
    return TrainOptions(**{**values, **changes})


def metrics(folder):
    return [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """A run of three checkpoints in one go."""
    folder = tmp_path_factory.mktemp("runs") / "unbroken"
    train(tiny_options(env_steps=2400), folder)
    return folder


def test_run_folder_has_config_metrics_tensorboard_and_two_checkpoints(unbroken):
    config = json.loads((unbroken / "config.json").read_text())
    assert config["agent_config"]["hidden"] == 16
    assert [line["env_steps"] for line in metrics(unbroken)] == [800, 1600, 2400]
    assert metrics(unbroken)[-1]["updates"] == (2400 - 400) // 32
    assert {"td_loss", "q", "success_rate_2", "success_rate_10"} <= set(metrics(unbroken)[-1])
    assert sorted(path.name for path in (unbroken / "checkpoints").iterdir()) == ["000000001600", "000000002400"]
    assert any((unbroken / "tensorboard").iterdir())


def test_resumed_run_equals_the_unbroken_one(unbroken, tmp_path):
    train(tiny_options(env_steps=1600), tmp_path)
    train(tiny_options(env_steps=2400), tmp_path, resume=True)
    assert metrics(tmp_path) == metrics(unbroken)
    for name in ("agent.safetensors", "training.safetensors", "random.json"):
        paths = [folder / "checkpoints" / "000000002400" / name for folder in (unbroken, tmp_path)]
        assert paths[0].read_bytes() == paths[1].read_bytes(), name


def test_resume_without_the_replay_fills_it_before_learning_goes_on(tmp_path):
    train(tiny_options(env_steps=800), tmp_path)
    (tmp_path / "checkpoints" / "000000000800" / "replay.npz").unlink()
    train(tiny_options(env_steps=1600), tmp_path, resume=True)
    assert metrics(tmp_path)[-1]["updates"] == (1600 - 400) // 32


def test_resume_reports_no_step_twice(tmp_path):
    train(tiny_options(env_steps=800), tmp_path)
    with open(tmp_path / "metrics.jsonl", "a") as file:
        file.write('{"env_steps":1200,"updates":1}\n{"env_st')  # what a killed process wrote after its last checkpoint
    train(tiny_options(env_steps=1600), tmp_path, resume=True)
    assert [line["env_steps"] for line in metrics(tmp_path)] == [800, 1600]


def test_resume_says_whether_the_run_goes_on_or_is_finished(unbroken, tmp_path):
    lines: list[str | None] = []
    train(tiny_options(env_steps=2400), unbroken, resume=True, report=lambda share, line: lines.append(line))
    assert lines[-1] == f"{unbroken}: the run is finished, at 2,400 steps"
    assert not any("resuming" in line for line in lines if line)
    train(tiny_options(env_steps=800), tmp_path)
    train(tiny_options(env_steps=1600), tmp_path, resume=True, report=lambda share, line: lines.append(line))
    assert f"resuming {tmp_path} at 800 steps" in lines


def test_folder_of_a_run_is_refused_without_resume_and_for_another_config(unbroken):
    with pytest.raises(InputError, match="holds a run already"):
        train(tiny_options(env_steps=2400), unbroken)
    other = {**TINY, "hidden": "32"}
    with pytest.raises(InputError, match="holds another run, differing in 'agent_config'"):
        train(tiny_options(env_steps=2400, overrides=tuple(other.items())), unbroken, resume=True)


def test_folder_in_use_by_another_process_is_refused(tmp_path):
    with RunFolder(tmp_path), pytest.raises(InputError, match="in use by another process"):
        RunFolder(tmp_path)


def test_folder_that_was_refused_is_free_again(tmp_path):
    (tmp_path / "checkpoints" / f"{800:012d}").mkdir(parents=True)
    with pytest.raises(InputError, match=r"expected config\.json beside the checkpoints"):
        RunFolder(tmp_path)
    (tmp_path / "config.json").touch()
    with RunFolder(tmp_path) as folder:
        assert len(folder.checkpoints()) == 1


def test_folder_whose_checkpoints_are_a_link_is_refused(tmp_path):
    others = tmp_path / "other" / "checkpoints" / f"{800:012d}.tmp"
    others.mkdir(parents=True)
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "config.json").touch()
    (tmp_path / "run" / "checkpoints").symlink_to(others.parent)
    with pytest.raises(InputError, match="checkpoints: can't write there: it is a link"):
        RunFolder(tmp_path / "run")
    assert others.exists()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"agent": "planner"}, "doesn't learn"),
        ({"agent": "nobody"}, "unknown agent"),
        ({"env_steps": None}, "expected --minutes or --env-steps"),
        ({"size": 14}, "unknown size"),
        ({"pairs": "some"}, "unknown pairs"),
        ({"overrides": (("colour", "red"),)}, "unknown config key 'colour'"),
    ],
)
def test_wrong_option_is_refused(tmp_path, changes, message):
    with pytest.raises(InputError, match=message):
        train(tiny_options(**{"env_steps": 100, **changes}), tmp_path / "run")


def test_loss_that_is_not_finite_stops_the_run_with_the_last_checkpoint(tmp_path):
    # A learning rate that no network survives.
    overrides = {**TINY, "learning_rate": "1e20", "max_gradient_norm": "1e20"}
    with pytest.raises(
        TrainingError, match=r"became (nan|inf|-inf) at update .*; last good checkpoint: .*000000000000"
    ):
        train(tiny_options(env_steps=100_000, overrides=tuple(overrides.items())), tmp_path)


def test_minutes_limit_a_sitting(tmp_path):
    begin = time.monotonic()
    train(tiny_options(minutes=0.02, checkpoint_steps=10**9), tmp_path)
    assert time.monotonic() - begin < 60  # far from endless; no measure of speed
    assert metrics(tmp_path)[-1]["env_steps"] > 0


def test_collector_gives_trajectories_that_hang_together():
    """Each next state follows the one before it, and cells, legs and ends are those of the environments."""
    walls = np.ones((7, 7), dtype=bool)
    walls[1:-1, 1:-1] = False
    spec = TaskSpec("local", (Maze(walls, "field"),), (1, 2), time_limit=10, num_goals=3)
    collector = Collector(spec, 4, seed=1)
    rng = np.random.default_rng(0)
    steps = [collector.step(rng.integers(6, size=4)) for _ in range(80)]
    for before, after in itertools.pairwise(steps):
        np.testing.assert_array_equal(after.begins, before.ended)
        assert (after.is_first | ~after.begins).all()
        unchanged = ~after.is_first
        np.testing.assert_array_equal(after.goal[unchanged], before.goal[unchanged])
    for step in steps:
        x, y = step.state[:, 0], step.state[:, 1]
        np.testing.assert_array_equal(step.cell, (6 - np.floor(y)) * 7 + np.floor(x))
        ended = step.ended
        x, y = step.final_state[ended, 0], step.final_state[ended, 1]
        np.testing.assert_array_equal(step.final_cell[ended], (6 - np.floor(y)) * 7 + np.floor(x))
    legs = sum(int(step.is_first.sum()) for step in steps)
    assert legs > sum(int(step.begins.sum()) for step in steps) > 4, "several goals an episode, several episodes"


class Rolling:
    """Goes forward, and notes what it is told of episodes."""

    def __init__(self):
        self.told = []

    def seed_episodes(self, seeds, mask):
        self.told.append((seeds.copy(), mask.copy()))

    def act(self, observation, is_first, state, explore=False):
        return np.zeros(len(is_first), dtype=np.int64), state + is_first


def test_collector_tells_actors_which_new_contexts_begin_episodes():
    walls = np.ones((7, 7), dtype=bool)
    walls[1:-1, 1:-1] = False
    spec = TaskSpec("local", (Maze(walls, "field"),), (1, 2), time_limit=6, num_goals=3)
    collector, actor, state = Collector(spec, 4, seed=1), Rolling(), np.zeros(4, dtype=int)
    steps = []
    for _ in range(40):
        step, state = collector.play(actor, state)
        steps.append(step)
    news = [step for step in steps if step.is_first.any()]
    np.testing.assert_array_equal(np.array([mask for _, mask in actor.told]), np.array([step.begins for step in news]))
    begun = [seed for seeds, mask in actor.told for seed in seeds[mask].tolist()]
    assert len(begun) > 4
    assert len(set(begun)) == len(begun), "no two episodes share a seed"


ray = pytest.importorskip("ray")


@pytest.fixture(scope="module")
def cluster():
    """A local Ray cluster, as small as it gets."""
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, object_store_memory=100 * 2**20)
    yield
    ray.shutdown()


@pytest.mark.filterwarnings("ignore")
def test_training_on_ray_keeps_the_replay_ratio(cluster, tmp_path):
    train(tiny_options(env_steps=1600, workers=2), tmp_path)
    last = metrics(tmp_path)[-1]
    assert last["env_steps"] >= 1600
    assert last["updates"] == (last["env_steps"] - 400) // 32
    assert math.isfinite(last["td_loss"])


@pytest.mark.filterwarnings("ignore")
def test_ray_actor_that_dies_is_replaced(cluster):
    from mazebench_agents.dqn import MAH

    from mazebench.agent import Interface
    from mazebench.tasks.registry import make_spec
    from mazebench.training.distributed import RaySource

    spec = make_spec("local", 13, num_goals=2)
    learner = MAH.build_learner(Interface("local", 13, 13), spec.mazes, overrides=TINY)
    with RaySource(dataclasses.replace(tiny_options(), workers=2), spec, learner) as source:
        source.restart(0)
        seen: set[int] = set()
        while seen != {0, 4}:
            seen |= {env for env, _ in source.collect()}
        ray.kill(source._players[1])
        counts = {0: 0, 4: 0}
        while counts[4] < 20:
            for env, experience in source.collect():
                counts[env] += 1
                assert len(experience.action) == 4
        assert source._num_failures == 1


def test_more_workers_than_environments_are_refused(cluster, tmp_path):
    with pytest.raises(InputError, match="at most 8 workers"):
        train(tiny_options(env_steps=100, workers=9), tmp_path)
