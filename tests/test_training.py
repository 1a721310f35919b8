"""The training loop: run folders, resuming, faults, and collecting."""

import itertools
import json
import logging
import math
import pathlib
import shlex
import shutil
import signal
import subprocess
import time

import hypothesis
import numpy as np
import pytest
from acting import RandomActor
from faults import TINY
from hypothesis import strategies
from processes import run_python
from simple_mazes import field

from mazebench import stopping
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.tasks.task import Task
from mazebench.training import loop
from mazebench.training.collector import Collector
from mazebench.training.loop import TrainingError, train
from mazebench.training.run_folder import RunFolder, read_metrics

ROOT = pathlib.Path(__file__).parents[1]
JSON = strategies.recursive(
    strategies.none() | strategies.integers() | strategies.text(),
    lambda inner: (
        strategies.lists(inner) | strategies.dictionaries(strategies.sampled_from(["updates", "loss"]), inner)
    ),
)


def tiny_options(**changes):
    values = {"agent": "mah", "overrides": TINY, "checkpoint_steps": 800, "eval_mazes": 1}
    return {**values, **changes}


def metrics(folder):
    return [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]


def assert_same_run(one, other):
    """Asserts that two runs of 2,400 steps wrote the same metrics and the same last checkpoint."""
    assert metrics(one) == metrics(other)
    for name in ("agent.safetensors", "training.safetensors", "random.json", "replay.npz", "counters.json"):
        paths = [folder / "checkpoints" / "000000002400" / name for folder in (one, other)]
        assert paths[0].read_bytes() == paths[1].read_bytes(), name


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """A run of three checkpoints in one go."""
    folder = tmp_path_factory.mktemp("runs") / "unbroken"
    train(**tiny_options(env_steps=2400), out=folder)
    return folder


def test_run_folder_has_config_metrics_tensorboard_and_two_checkpoints(unbroken):
    config = json.loads((unbroken / "config.json").read_text())
    assert config["agent_config"]["hidden"] == 16
    assert [line["env_steps"] for line in metrics(unbroken)] == [800, 1600, 2400]
    assert metrics(unbroken)[-1]["updates"] == (2400 - 400) // 32
    assert {"td_loss", "q", "success_rate_2", "success_rate_10"} <= set(metrics(unbroken)[-1])
    assert sorted(path.name for path in (unbroken / "checkpoints").iterdir()) == ["000000001600", "000000002400"]
    assert any((unbroken / "tensorboard").iterdir())


def test_resume_without_the_replay_fills_it_before_learning_goes_on(unbroken, tmp_path):
    folder = shutil.copytree(unbroken, tmp_path / "run")
    (folder / "checkpoints" / "000000002400" / "replay.npz").unlink()
    train(**tiny_options(env_steps=2800), out=folder, resume=True)
    assert metrics(folder)[-1]["updates"] == (2800 - 400) // 32


def test_resume_reports_no_step_twice(unbroken, tmp_path):
    folder = shutil.copytree(unbroken, tmp_path / "run")
    with open(folder / "metrics.jsonl", "a") as file:
        file.write('{"env_steps":2408,"updates":70}\n{"env_st')  # what a killed process wrote after its last checkpoint
    train(**tiny_options(env_steps=2800), out=folder, resume=True)
    assert [line["env_steps"] for line in metrics(folder)] == [800, 1600, 2400, 2800]


@pytest.mark.parametrize(
    ("name", "edit", "message"),
    [
        ("counters.json", lambda content: {}, "expected the counters at 2400 agent steps"),
        ("counters.json", lambda content: [], "expected the counters of a training"),
        ("counters.json", lambda content: content | {"updates": "many"}, "expected the counters of a training"),
        ("counters.json", lambda content: content | {"env_steps": 1600}, "expected the counters at 2400"),
        ("counters.json", lambda content: {"updbtes": 3, **content}, "expected the counters at 2400"),
        ("random.json", lambda content: {}, "expected the state of a random generator"),
        ("random.json", lambda content: content | {"bit_generator": "PCG63"}, "expected the state of a random"),
        ("random.json", lambda content: content | {"state": {"state": -1, "inc": 2**200}}, "expected the state of"),
    ],
)
def test_a_state_of_another_form_is_refused(unbroken, tmp_path, name, edit, message):
    folder = shutil.copytree(unbroken, tmp_path / "run")
    path = folder / "checkpoints" / "000000002400" / name
    path.write_text(json.dumps(edit(json.loads(path.read_text()))))
    with pytest.raises(InputError, match=rf"{name}: {message}"):
        train(**tiny_options(env_steps=3200), out=folder, resume=True)


@hypothesis.given(line=JSON)
def test_metrics_of_another_form_are_refused(tmp_path_factory, line):
    folder = tmp_path_factory.getbasetemp()
    (folder / "metrics.jsonl").write_text(json.dumps(line) + "\n")
    with pytest.raises(InputError, match=r"metrics\.jsonl: expected another line 1, found "):
        read_metrics(folder)


def test_a_finished_run_is_not_run_again(unbroken, caplog):
    caplog.set_level(logging.INFO, "mazebench.training")
    train(**tiny_options(env_steps=2400), out=unbroken, resume=True)
    assert caplog.messages == [f"{unbroken}: the run is finished, at 2,400 steps"]


def test_folder_of_a_run_is_refused_without_resume_and_for_another_config(unbroken):
    with pytest.raises(InputError, match="holds a run already"):
        train(**tiny_options(env_steps=2400), out=unbroken)
    other = {**TINY, "hidden": "32"}
    with pytest.raises(InputError, match="holds another run, differing in 'agent_config'"):
        train(**tiny_options(env_steps=2400, overrides=other), out=unbroken, resume=True)


def test_a_second_training_in_the_folder_is_refused_while_the_first_writes(tmp_path):
    with RunFolder(tmp_path):
        half_written = tmp_path / "checkpoints" / "000000000800.tmp"
        half_written.mkdir()
        with pytest.raises(InputError, match="another training writes there; end it, or name another folder"):
            train(**tiny_options(env_steps=800), out=tmp_path, resume=True)
        assert half_written.exists()
    with RunFolder(tmp_path):
        assert not half_written.exists()


def stopped(options, folder, wanted, resume=False):
    """Runs a training that is stopped with SIGTERM at its first status for which `wanted` holds."""
    is_stopped = False

    def stop(status):
        nonlocal is_stopped
        if wanted(status) and not is_stopped:
            is_stopped = True
            signal.raise_signal(signal.SIGTERM)

    with stopping.listening(), pytest.raises(SystemExit), stopping.stoppable(lambda: ("it",), waits=True):
        train(**options, out=folder, resume=resume, progress=stop)


def checkpoints(folder):
    return sorted(int(path.name) for path in (folder / "checkpoints").iterdir())


def test_stopped_run_leaves_a_savepoint_and_goes_on_from_it_to_its_next_milestone(unbroken, tmp_path, caplog):
    caplog.set_level(logging.INFO, "mazebench.training")
    stopped(tiny_options(env_steps=2400), tmp_path, lambda status: status.counters.env_steps == 1208)
    assert checkpoints(tmp_path) == [800, 1208]
    assert metrics(tmp_path) == metrics(unbroken)[:1]
    train(**tiny_options(env_steps=2400), out=tmp_path, resume=True)
    assert f"resuming {tmp_path} at 1,208 steps" in caplog.messages
    assert checkpoints(tmp_path) == [1600, 2400]
    assert [line["env_steps"] for line in metrics(tmp_path)] == [800, 1600, 2400]
    assert metrics(tmp_path)[-1]["updates"] == (2400 - 400) // 32


def test_run_that_is_stopped_while_it_is_evaluated_is_resumed_to_the_same_bytes(unbroken, tmp_path):
    stopped(
        tiny_options(env_steps=2400), tmp_path, lambda status: status.evaluated and status.counters.env_steps == 1600
    )
    assert checkpoints(tmp_path) == [800, 1600]
    assert metrics(tmp_path) == metrics(unbroken)[:1]
    stopped(
        tiny_options(env_steps=2400),
        tmp_path,
        lambda status: status.evaluated and status.counters.env_steps == 2400,
        True,
    )
    train(**tiny_options(env_steps=2400), out=tmp_path, resume=True)
    assert_same_run(tmp_path, unbroken)


def test_savepoints_do_not_change_the_run_that_saves_them(unbroken, tmp_path):
    train(**tiny_options(env_steps=2400, checkpoint_minutes=1e-3), out=tmp_path)
    assert_same_run(tmp_path, unbroken)


def test_without_savepoints_a_stopped_run_goes_on_from_its_last_milestone_to_the_same_bytes(unbroken, tmp_path):
    options = tiny_options(env_steps=2400, checkpoint_minutes=0)
    stopped(options, tmp_path, lambda status: status.counters.env_steps == 1208)
    assert checkpoints(tmp_path) == [0, 800]
    train(**options, out=tmp_path, resume=True)
    assert_same_run(tmp_path, unbroken)


def test_metrics_have_a_line_every_so_many_steps_with_the_losses_since_the_line_before(unbroken, tmp_path, monkeypatch):
    monkeypatch.setattr(loop, "STEPS_BETWEEN_LINES", 400)
    options = tiny_options(env_steps=1600)
    train(**options, out=tmp_path / "whole")
    lines = metrics(tmp_path / "whole")
    assert [line["env_steps"] for line in lines] == [400, 800, 1200, 1600]
    assert ["success_rate_2" in line for line in lines] == [False, True] * 2
    assert "td_loss" not in lines[0]  # no update yet
    updates = [line["updates"] for line in lines]
    of_milestone = (updates[3] - updates[2]) * lines[3]["td_loss"] + (updates[2] - updates[1]) * lines[2]["td_loss"]
    assert math.isclose(of_milestone / (updates[3] - updates[1]), metrics(unbroken)[1]["td_loss"])

    stopped(options, tmp_path / "stopped", lambda status: status.counters.env_steps == 1304)
    train(**options, out=tmp_path / "stopped", resume=True)
    resumed = metrics(tmp_path / "stopped")
    assert resumed[:3] == lines[:3]
    assert [line["env_steps"] for line in resumed] == [line["env_steps"] for line in lines]


def test_loss_that_is_not_finite_stops_the_run_with_the_last_checkpoint(tmp_path):
    # A learning rate that no network survives.
    overrides = {**TINY, "learning_rate": "1e20", "max_gradient_norm": "1e20"}
    with pytest.raises(
        TrainingError, match=r"became (nan|inf|-inf) at update .*; last good checkpoint: .*000000000000"
    ):
        train(**tiny_options(env_steps=100_000, overrides=overrides), out=tmp_path)


def test_minutes_limit_a_command(tmp_path):
    begin = time.monotonic()
    train(**tiny_options(minutes=0.02, checkpoint_steps=10**9), out=tmp_path)
    assert time.monotonic() - begin < 60  # far from endless; no measure of speed
    assert metrics(tmp_path)[-1]["env_steps"] > 0


def test_the_share_of_a_run_counts_the_commands_before():
    """The second command makes 1,000 steps after 500: halfway, 1,000 of 1,500 are made."""
    assert loop.share_of_run(500, 0, 0.5) == 0.5
    assert loop.share_of_run(1000, 500, 0.5) == pytest.approx(2 / 3)
    assert loop.share_of_run(1500, 500, 1.0) == 1
    assert loop.share_of_run(0, 0, 0.0) == 0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--track", "rebuilt", "--level", "2,3"), "--track rebuilt --level {} --split dev"),
        (("--size", "15", "--map-flip", "0.1", "--distances", "2"), "--size 15 --distances 2 --map-flip 0.1"),
    ],
    ids=("track", "local"),
)
def test_train_prints_the_evaluation_of_what_it_trained(command, options, words):
    values = [word for key, value in TINY.items() for word in ("--set", f"{key}={value}")]
    status, printed, _ = command(
        "train", "--agent", "mah", "--env-steps", "8", "--eval-mazes", "1", "--out", "a run", *values, *options
    )
    lines = [line for line in printed.splitlines() if line.startswith("mazebench eval")]
    levels = (2, 3) if "--track" in options else (0,)
    start = "mazebench eval --agent mah --checkpoint 'a run' "
    assert (status, lines) == (0, [start + words.format(level) for level in levels])
    status, printed, _ = command(*shlex.split(lines[0])[1:])
    assert status == 0
    assert ("mah: rebuilt 2, dev mazes 31 x 31" in printed) == ("--track" in options)
    assert printed.startswith("evaluating in the eval mazes of the paper's protocol") == ("--size" in options)


def collect(actor, num_steps, **options):
    """The steps of an agent in four environments of a field."""
    spec = Task.of(mazes=field(7), distances=(1, 2), num_goals=3, **options)
    return list(itertools.islice(Collector(spec, 4).collect(actor, seed=1), num_steps))


def test_collector_gives_trajectories_that_hang_together():
    """Each next state follows the one before it, and cells, legs and ends are those of the environments."""
    steps = collect(RandomActor(), 80, time_limit=10)
    for before, after in itertools.pairwise(steps):
        np.testing.assert_array_equal(after.new_episode, before.ended)
        assert (after.new_context | ~after.new_episode).all()
        unchanged = ~after.new_context
        np.testing.assert_array_equal(after.goal[unchanged], before.goal[unchanged])
    for step in steps:
        x, y = step.state[:, 0], step.state[:, 1]
        np.testing.assert_array_equal(step.cell, (6 - np.floor(y)) * 7 + np.floor(x))
        ended = step.ended
        x, y = step.final_state[ended, 0], step.final_state[ended, 1]
        np.testing.assert_array_equal(step.final_cell[ended], (6 - np.floor(y)) * 7 + np.floor(x))
    legs = sum(int(step.new_context.sum()) for step in steps)
    assert legs > sum(int(step.new_episode.sum()) for step in steps) > 4, "several goals an episode, several episodes"


def test_drives_that_are_cut_end_where_the_body_is():
    """After every five steps, in all four environments, some of which reach a goal before."""
    task = Task.of(mazes=field(7), distances=(1, 2))
    steps = list(itertools.islice(Collector(task, 4).collect(RandomActor(), seed=1, drive_steps=5), 40))
    for number, (before, after) in enumerate(itertools.pairwise(steps), 1):
        np.testing.assert_array_equal(after.new_episode, before.ended)
        is_cut = number % 5 == 0
        assert before.ended.all() == is_cut
        ended, x, y = before.ended, before.final_state[:, 0], before.final_state[:, 1]
        np.testing.assert_array_equal(before.final_cell[ended], ((6 - np.floor(y)) * 7 + np.floor(x))[ended])
        moved = np.hypot(x - before.state[:, 0], y - before.state[:, 1])
        assert (moved[ended] < 1).all()
    assert any(step.terminated.any() for step in steps)
    cut = [step for step in steps if step.ended.all()]
    assert not any(step.terminated.all() for step in cut)


class Witness(RandomActor):
    """Explores at random; what it notes of a step is the seeds that it was given."""

    def act(self, inputs, state, explore=False):
        return super().act(inputs, inputs.seed, explore)

    def notes(self, state):
        return state


def test_collector_gives_every_episode_a_seed_of_its_own_that_is_not_the_episodes():
    steps = collect(Witness(), 40, time_limit=6)
    env = MazeVectorEnv(Task.of(mazes=field(7), distances=(1, 2), num_goals=3, time_limit=6), 4)
    observation, _ = env.reset(seed=np.random.SeedSequence(1).generate_state(4).tolist())  # the same environments
    np.testing.assert_array_equal(observation["state"], steps[0].state)
    seeds = [seed for step in steps for seed in step.notes[step.new_episode].tolist()]
    assert len(set(seeds)) == len(seeds) > 4
    assert not set(seeds) & {episode.seed for episode in env.episodes}
    for before, after in itertools.pairwise(steps):
        np.testing.assert_array_equal(before.notes != after.notes, after.new_episode)


def test_the_learned_agent_of_the_page_on_extending_learns(tmp_path):
    """docs/examples/extend/learned_agent.diff, applied to a tree of links to the code."""
    (tmp_path / "agents").mkdir()
    for child in (ROOT / "agents").iterdir():
        (tmp_path / "agents" / child.name).symlink_to(child)
    (tmp_path / "mazebench_agents").symlink_to(tmp_path / "agents")
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    diff = ROOT / "docs" / "examples" / "extend" / "learned_agent.diff"
    subprocess.run(["git", "apply", diff], cwd=tmp_path, check=True)
    options = "--kinds dfs --num-mazes 8 --sensors lidar --env-steps 8000 --checkpoint-steps 8000 --eval-mazes 4"
    values = "total_steps=8000", "num_envs=40", "rollout_steps=25", "epochs=8", "learning_rate=0.003"
    arguments = [*options.split(), *(each for value in values for each in ("--set", value)), "--out", tmp_path / "run"]
    agent = ("--agent", "mazebench_agents.homing:Homing")
    run_python("-m", "mazebench", "train", *agent, *arguments, variables={"PYTHONPATH": str(tmp_path)}, cwd=tmp_path)
    learned = metrics(tmp_path / "run")[-1]
    assert learned["agreement"] > 0.4
    assert learned["success_rate_2"] > 0.6
