"""The neural planner: its layer of cheapest ways, its losses by hand, its contract, and that both teachers teach it."""

import json

import numpy as np
import pytest
import torch
from mazebench_agents.common.path_layer import FAR, CheapestWays
from mazebench_agents.neural_planner import NeuralPlanner
from mazebench_agents.neural_planner.network import PlannerNetwork, Situation, grid_bytes, motion_features
from mazebench_agents.neural_planner.reward_learner import advantages, clipped_loss
from simple_mazes import field

from mazebench.errors import InputError
from mazebench.evaluation.chunk import run_trials
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials
from mazebench.testing import check_agent
from mazebench.training.collector import Collector
from mazebench.training.loop import longest_distance, train
from mazebench.training.train_options import TrainOptions

SMALL = {"num_envs": 16, "rollout_steps": 20, "minibatches": 2, "channels": 4, "hidden": 16}


def ways_by_relaxation(cost: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The layer's fixed point, by relaxing every cell until nothing changes."""
    size, ways = len(cost), end.copy()
    for _ in range(size * size):
        for r in range(size):
            for c in range(size):
                for down in (-1, 0, 1):
                    for right in (-1, 0, 1):
                        m, k = r + down, c + right
                        if not (0 <= m < size and 0 <= k < size):
                            continue
                        step = cost[r, c]
                        if down and right:
                            step = (2**0.5 - 0.5) * cost[r, c] + (cost[m, c] + cost[r, k]) / 4
                        ways[r, c] = min(ways[r, c], ways[m, k] + step)
    return ways


def random_grid(seed: int, size: int = 6) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    cost = 1 + 3 * torch.rand(1, size, size, generator=generator)
    end = torch.full((1, size, size), FAR)
    end[0, 1, 2], end[0, 4, 4] = 0.0, 0.7
    return cost, end


@pytest.mark.parametrize("seed", range(3))
def test_ways_are_the_fixed_point(seed):
    cost, end = random_grid(seed)
    expected = ways_by_relaxation(cost[0].double().numpy(), end[0].double().numpy())
    np.testing.assert_allclose(CheapestWays.apply(cost, end)[0], expected, rtol=1e-5)


def test_gradients_are_finite_differences():
    cost, end = random_grid(5)
    weight = torch.randn(cost.shape, generator=torch.Generator().manual_seed(1))
    leaves = cost.clone().requires_grad_(), end.clone().requires_grad_()
    (CheapestWays.apply(*leaves) * weight).sum().backward()
    for number, values in enumerate((cost, end)):
        for r, c in [(1, 2), (4, 4), (2, 2), (3, 1), (0, 5)] if number == 0 else [(1, 2), (4, 4)]:
            off, sums = torch.zeros_like(values), []
            off[0, r, c] = 5e-3
            for moved in (values + off, values - off):
                inputs = (moved, end) if number == 0 else (cost, moved)
                sums.append((CheapestWays.apply(*inputs).double() * weight).sum().item())
            assert leaves[number].grad[0, r, c].item() == pytest.approx((sums[0] - sums[1]) / 1e-2, abs=2e-2)


def test_no_way_slips_between_two_walls_that_touch_at_a_corner():
    cost, end = 1 + 99 * torch.eye(4).flip(0)[None], torch.full((1, 4, 4), FAR)
    end[0, 0, 0] = 0.0
    ways = CheapestWays.apply(cost, end)
    assert ways[0, 1, 1] == pytest.approx(2**0.5)
    assert ways[0, 2, 2] > 50


@pytest.mark.parametrize("size", [5, 12])
def test_network_reads_ways_in_the_frame_of_the_body(size):
    """A body turned by a quarter, in a world turned by a quarter, reads the same but for the convolutions."""
    torch.manual_seed(0)
    network = PlannerNetwork(4, 16, ways=True)
    for parameter in network.costs.parameters():
        torch.nn.init.zeros_(parameter)  # all cells cost the same
    goal = np.zeros((size, size))
    goal[1, size - 2] = 1.0
    free = np.zeros((size, size))
    grids = np.stack([grid_bytes(free, free, free, each) for each in (goal, np.rot90(goal))])
    x, y = 1.7, 2.2
    pose = torch.tensor([[x, y, 0.3], [size - y, x, 0.3 + np.pi / 2]], dtype=torch.float32)
    situation = Situation(pose, torch.ones(2, 32), torch.from_numpy(motion_features(np.ones((2, 3)), np.zeros((2, 2)))))
    logits, value = network(network.plan(torch.from_numpy(grids)), torch.arange(2), situation)
    torch.testing.assert_close(logits[0], logits[1], rtol=0, atol=2e-3)
    torch.testing.assert_close(value[0], value[1], rtol=0, atol=2e-3)
    assert logits[0].std() > 0.05


def test_advantages_by_hand():
    """Two environments: one goes on, in the other an episode ends in the goal, and then one is cut short."""
    reward = np.array([[-1.0, -1.0], [-1.0, 0.0], [-1.0, -1.0], [-1.0, -1.0]])
    value = np.array([[1.0, 1.0], [2.0, 3.0], [4.0, 5.0], [6.0, 7.0]])
    terminated = np.array([[False, False], [False, True], [False, False], [False, False]])
    ended = terminated | np.array([[False, False], [False, False], [False, True], [False, False]])
    found = advantages(reward, value, terminated, ended, discount=0.5, trace=0.5)
    errors = np.array([[-1.0, -0.5], [-1.0, -3.0], [-2.0, -3.5]])  # r + 0.5 v' - v
    expected = errors.copy()
    expected[1, 0] += 0.25 * expected[2, 0]
    expected[0] += 0.25 * expected[1]
    np.testing.assert_allclose(found, expected)


def test_clipped_loss_by_hand():
    advantage = torch.tensor([1.0, -1.0])
    loss = clipped_loss(torch.log(torch.tensor([1.5, 1.5])), advantage, 0.2)
    assert loss.item() == pytest.approx(-(1.2 - 1.5) / 2, rel=1e-4)


@pytest.mark.parametrize("options", [{"sensors": "lidar"}, {"task": "adrift", "level": 3}], ids=str)
def test_agent_keeps_its_contract(tmp_path, options):
    learner = NeuralPlanner.build_learner(Task.of(mazes=field(7)), overrides=text(SMALL))
    learner.save(tmp_path, {})
    check_agent(NeuralPlanner, **{"task": "hierarchical", **options}, checkpoint=tmp_path / "agent.safetensors")


@pytest.mark.parametrize("teacher", ["reward", "oracle"])
def test_both_teachers_teach(teacher):
    """In a field of 4 x 4 cells, where the untrained agent finds few goals."""
    spec = Task.of(mazes=field(6), distances=(2, 3, 4), time_limit=12, num_goals=1, sensors="lidar")
    values = SMALL | {"teacher": teacher, "num_envs": 32, "minibatches": 4, "hidden": 64, "epochs": 6}
    values |= {"learning_rate": 3e-3, "reward_scale": 0.1}
    learner = NeuralPlanner.build_learner(spec, overrides=text(values))
    trials = dict(enumerate(draw_trials(spec, 32, seed=7)))

    def success_rate():
        played = run_trials(learner.actor, spec, trials, 64)
        return np.mean([result.success for results in played for result in results])

    before = success_rate()
    experience = Collector(spec, learner.num_envs).collect(learner.actor, seed=0)
    for _ in range(6 if teacher == "reward" else 3):
        for _ in range(20):
            learner.observe(next(experience))
        learner.update()
    assert before < 0.3
    assert success_rate() > 0.7


def text(values):
    return {name: str(value) for name, value in values.items()}


TRACKS = {"task": ("building", "rebuilt"), "level": (1, 3), "kinds": ("dfs",), "fresh": True}
GROWING = {"distances": (1, 2, 3, 4, 5), "first_distance": 2, "widen_steps": 1000}


def run(out, env_steps, resume=False, teacher="reward", **options):
    """A training with a milestone every 320 steps, which are a rollout; returns its last checkpoint."""
    overrides = SMALL | {"teacher": teacher, "total_steps": 1000}
    values = {"overrides": overrides, "checkpoint_steps": 320, "eval_mazes": 1}
    train("neural-planner", out=out, env_steps=env_steps, resume=resume, **values, **options)
    return max((out / "checkpoints").iterdir())


@pytest.mark.parametrize(
    "options",
    [
        TRACKS | GROWING | {"teacher": "oracle"},
        {"distances": 10, "time_limit": 5, "num_goals": 1},  # all episodes end at the milestone
    ],
    ids=("oracle", "rewards, all end"),
)
def test_resumed_run_is_the_unbroken_one(tmp_path, options):
    whole = run(tmp_path / "whole", 640, **options)
    run(tmp_path / "broken", 320, **options)
    resumed = run(tmp_path / "broken", 640, resume=True, **options)
    assert whole.name == resumed.name
    files = {path.name for path in whole.iterdir()}
    assert ("replay.npz" in files) == (options.get("teacher") == "oracle")
    for name in files:
        assert (whole / name).read_bytes() == (resumed / name).read_bytes(), name


def test_metrics_and_config_of_several_tracks(tmp_path):
    run(tmp_path / "whole", 320, **TRACKS, **GROWING)
    lines = [json.loads(line) for line in (tmp_path / "whole" / "metrics.jsonl").read_text().splitlines()]
    assert lines[-1]["updates"] == 1
    assert {"success_rate_building_1", "success_rate_rebuilt_5"} <= set(lines[-1])
    config = json.loads((tmp_path / "whole" / "config.json").read_text())
    assert config["also"] == ["rebuilt"]
    assert config["first_distance"] == 2


def test_the_learning_rate_falls_with_the_run(tmp_path):
    """It is whole at half of the run, and 2 % at its end, however long that is."""
    task = Task.of(mazes=field(7), distances=(2,), sensors="lidar")
    learner = NeuralPlanner.build_learner(task, overrides=text(SMALL))
    optimizer = learner.descent._optimizer
    for share, factor in ((0.5, 1.0), (0.75, 0.5), (1.0, 0.02)):
        learner.share_done = share
        learner.descent.step(sum(parameter.sum() for parameter in learner.actor.network.parameters()))
        rates = [group["lr"] for group in optimizer.param_groups]
        assert (min(rates), max(rates)) == pytest.approx((1e-3 * factor, 3e-3 * factor))  # those of costs are higher


def config_of(out, **options):
    """The config of a training that ends in its first step."""

    def end(status):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train("neural-planner", "building", out=out, env_steps=8, eval_mazes=1, progress=end, **options)
    config = json.loads((out / "config.json").read_text())
    task, agent = config["task"], config["agent_config"]
    distances = task["distances"][0], task["distances"][-1], config.get("first_distance")
    return task["fresh"], task["kinds"], *distances, *(agent[name] for name in FORMER)


FORMER = {"teacher": "reward", "num_envs": 80, "learning_rate": 7e-4, "minibatches": 8, "total_steps": 1_000_000}
FORMER |= {"cost_rate": 1.0}


def test_by_default_a_training_on_a_track_imitates_the_oracle_in_fresh_mazes_with_near_goals_first(tmp_path):
    kinds = ["dfs", "house", "rooms"]
    assert config_of(tmp_path) == (True, kinds, 1, 40, 8, "oracle", 40, 1e-3, 16, None, 3.0)


def test_the_former_defaults_can_be_named(tmp_path):
    options = {"fresh": False, "distances": range(15, 41), "first_distance": 0, "overrides": FORMER}
    assert config_of(tmp_path, **options) == (False, [], 15, 40, None, *FORMER.values())


def test_other_agents_learn_one_task_at_a_time(tmp_path):
    with pytest.raises(InputError, match="agent 'dqn': learns one track at a time, found building, rebuilt"):
        train("dqn", ("building", "rebuilt"), out=tmp_path, minutes=1)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"task": ("building", "building")}, "expected different tracks, found building, building"),
        ({"task": ("building", "local")}, "expected different tracks, found building, local"),
        ({"first_distance": 50}, "expected --first-distance of at most 5, the farthest goals, found more"),
        ({"first_distance": 2, "pairs": "fixed"}, "expected starts and goals that are drawn, found given ones"),
    ],
)
def test_options_that_do_not_go_together_are_refused(tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        train("neural-planner", out=tmp_path, minutes=1, **options)


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut", None], ids=("empty", "cut", "foreign"))
def test_damaged_rollouts_are_refused(tmp_path, content):
    learner = NeuralPlanner.build_learner(Task.of(mazes=field(7)), overrides=text(SMALL | {"teacher": "oracle"}))
    learner.save(tmp_path, {})
    if content is None:
        np.savez(tmp_path / "replay.npz", foreign=np.zeros(3))
    else:
        (tmp_path / "replay.npz").write_bytes(content)
    with pytest.raises(InputError, match=r"replay\.npz"):
        learner.load(tmp_path)


def test_goals_get_farther_as_the_run_goes_on():
    task = Task.of(mazes=field(7), distances=(2, 4, 6))
    options = TrainOptions(agent="neural-planner", minutes=1, first_distance=3, widen_steps=300)
    assert [longest_distance(options, [task], steps, 0) for steps in (0, 100, 299, 300, 10**6)] == [3, 4, 5, 6, 6]
    of_run = options.replace(widen_steps=None)
    assert [longest_distance(of_run, [task], 0, share) for share in (0, 0.14, 0.39, 0.4, 1)] == [3, 4, 5, 6, 6]
    learner = NeuralPlanner.build_learner(task, overrides=text(SMALL))
    collector = Collector(task, 16)

    def distances(longest):
        collector.limit_distances(longest)
        step = next(collector.collect(learner.actor, seed=0))
        rows, columns = np.divmod(np.stack([step.start, step.goal]), 7)
        return set((abs(rows[0] - rows[1]) + abs(columns[0] - columns[1])).tolist())

    assert distances(1) == {2}, "the nearest that the task has"
    assert distances(5) == {2, 4}
    assert distances(6) == {2, 4, 6}
