"""Environments and features for Stable-Baselines3."""

from __future__ import annotations

import numpy as np
import pytest

import mazebench
from mazebench.errors import InputError

pytest.importorskip("stable_baselines3")

import torch
from acting import inputs_of
from mazebench_agents.integrations.distance_field import DistanceField
from mazebench_agents.integrations.sb3 import FieldVecEnv, MapFeatures, MazeVecEnv, WayFeatures
from mazebench_agents.neural_planner.neural_planner import NeuralPlanner
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

torch.set_num_threads(1)  # two that share a core with other tests wait for each other
NUM_READ = 3 * 97
OPTIONS = {"level": (1, 2), "distances": (1, 2), "reward": "progress"}


def test_episodes_are_those_of_the_vector_environment():
    ours, theirs = MazeVecEnv(mazebench.make_vec("rebuilt", 3, **OPTIONS)), mazebench.make_vec("rebuilt", 3, **OPTIONS)
    ours.seed(5)
    found, (expected, _) = ours.reset(), theirs.reset(seed=5)
    ends, rng = [], np.random.default_rng(0)
    for _ in range(120):
        np.testing.assert_equal(found, expected)
        actions = np.where(rng.random(3) < 0.7, 0, rng.integers(6, size=3))
        found, rewards, dones, infos = ours.step(actions)
        expected, *others, info = theirs.step(actions)
        for one, other in ((rewards, others[0]), (dones, others[1] | others[2])):
            np.testing.assert_array_equal(one, other, strict=True)
        assert [bool(told) for told in infos] == dones.tolist()
        for slot in np.flatnonzero(dones):
            np.testing.assert_equal(infos[slot]["terminal_observation"], info["final_obs"][slot])
            assert infos[slot]["is_success"] == others[1][slot] != infos[slot]["TimeLimit.truncated"]
            assert {name: infos[slot][name] for name in ("level", "distance", "steps")} == {
                name: info["final_info"][name][slot] for name in ("level", "distance", "steps")
            }
            ends.append(infos[slot]["is_success"])
    assert set(ends) == {True, False}


def test_environments_that_do_not_go_on_by_themselves_are_refused():
    with pytest.raises(InputError, match="expected autoreset_mode 'SameStep', found 'Disabled'"):
        MazeVecEnv(mazebench.make_vec(autoreset_mode="Disabled"))


@pytest.mark.parametrize(
    ("task", "reader", "num_features"),
    [
        ("local", MapFeatures, 256 + 12),
        ("rebuilt", MapFeatures, 256 + 12 + 32),
        ("building", WayFeatures, NUM_READ + 32 + 15 + 2),
    ],
)
def test_a_policy_learns_from_them(task, reader, num_features):
    envs = VecMonitor(MazeVecEnv(mazebench.make_vec(task, 4, distances=(1, 2))))
    policy = {"net_arch": [16], "features_extractor_class": reader}
    model = PPO("MultiInputPolicy", envs, n_steps=32, batch_size=64, n_epochs=1, policy_kwargs=policy, device="cpu")
    features = model.policy.features_extractor
    before = list(features.parameters())[-1].clone()
    model.learn(128)
    assert not torch.equal(before, list(features.parameters())[-1])
    assert features.features_dim == num_features
    actions, _ = model.predict(envs.reset())
    assert actions.shape == (4,)


def test_features_of_the_distance_field_are_those_of_each_episodes_own_map():
    envs = FieldVecEnv(MazeVecEnv(mazebench.make_vec("rebuilt", 3, **OPTIONS)))
    plain = MazeVecEnv(mazebench.make_vec("rebuilt", 3, **OPTIONS))
    for each in (envs, plain):
        each.seed(5)
    found, observations = envs.reset(), plain.reset()
    field, rng, ended = DistanceField(3), np.random.default_rng(0), 0
    is_new = np.ones(3, bool)
    for _ in range(60):
        field.read(observations["context"], is_new)
        np.testing.assert_array_equal(found, field.features(observations))
        assert found.shape == (3, *envs.observation_space.shape)
        actions = np.where(rng.random(3) < 0.7, 0, rng.integers(6, size=3))
        found, _, is_new, infos = envs.step(actions)
        observations, _, _, others = plain.step(actions)
        for slot in np.flatnonzero(is_new):
            last = {name: values[None] for name, values in others[slot]["terminal_observation"].items()}
            expected = field.features(last, np.array([slot]))[0]
            np.testing.assert_array_equal(infos[slot]["terminal_observation"], expected)
            ended += 1
    assert ended


def test_ways_are_read_as_by_the_neural_planner():
    envs = MazeVecEnv(mazebench.make_vec("building", 3, distances=(3,)))
    agent = NeuralPlanner.build_learner(envs.envs.task).actor
    reader = WayFeatures(envs.observation_space)
    reader.planner.load_state_dict(agent.network.state_dict(), strict=False)
    envs.seed(0)
    observation = envs.reset()
    state = agent.initial_state(3)
    agent.act(inputs_of(observation, np.ones(3, dtype=bool)), state, explore=True)
    grids = torch.tensor(np.stack(state.choice.shared))
    walls = 255 * (grids[:, 0] > 127)
    grids[:, 0], grids[:, 1], grids[:, 2] = walls, walls, 128  # the map as it is shown, and nothing that was sensed
    with torch.no_grad():
        expected = agent.network.features(agent.network.plan(grids), torch.arange(3), state.choice.parts)
    found = reader({name: torch.as_tensor(values) for name, values in observation.items()})
    torch.testing.assert_close(found[:, :NUM_READ], expected[:, :NUM_READ])  # at points around the body
    differ = (found - expected).abs() > 0.03  # the lidar's noise; rays that are lost or pass a corner differ by more
    assert differ.sum() <= 8  # of 96 rays
    found.sum().backward()
    assert all(weight.grad.abs().sum() > 0 for weight in reader.planner.costs.parameters())


@pytest.mark.parametrize("sensors", ["egocentric", "lidar,depth,labels"])
@pytest.mark.parametrize("reader", [MapFeatures, WayFeatures, FieldVecEnv])
def test_sensors_that_features_do_not_read_are_refused_by_name(reader, sensors):
    envs = MazeVecEnv(mazebench.make_vec("building", 2, sensors=sensors))
    found = sensors.removeprefix("lidar,").replace(",", ", ")
    with pytest.raises(InputError, match=f"^{reader.__name__}: reads state, context, lidar, found {found}$"):
        reader(envs if reader is FieldVecEnv else envs.observation_space)


def test_a_method_acts_once_on_all_environments_and_not_on_some():
    envs = MazeVecEnv(mazebench.make_vec("local", 3))
    for indices in (None, [2, 0, 1]):
        velocities = envs.env_method("velocity", indices=indices)
        assert [each.shape for each in velocities] == [(3, 2)] * 3
    for act in (envs.env_method, envs.set_attr):
        with pytest.raises(InputError, match=r"^expected no indices, .*, found \[0\]$"):
            act("draw_distances", [1], indices=[0])
