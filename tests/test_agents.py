"""Agents: the contract that all keep, how they are found, and what the hard-coded ones can do."""

from __future__ import annotations

import dataclasses
import sys

import numpy as np
import pytest

from mazebench.agent import Interface, agent_names, load_agent_class
from mazebench.errors import InputError
from mazebench.evaluation.protocol import select_trials
from mazebench.evaluation.runner import run_trials
from mazebench.maps.benchmark import load_mazes
from mazebench.tasks.registry import make_spec
from mazebench.testing import ConformanceError, check_agent

INTERFACE = Interface("local", 13, 13)
MODULE_AT_HAND = "class Mine:\n    build = initial_state = act = print\n"


class Toy:
    """A conforming agent to break."""

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        return cls()

    def initial_state(self, batch_size):
        return np.zeros(batch_size, dtype=int)

    def act(self, observation, is_first, state, explore=False):
        state = np.where(is_first, 0, state)
        return state % 6, state + 1


class OneTooMany(Toy):
    def act(self, observation, is_first, state, explore=False):
        return np.zeros(len(is_first) + 1, dtype=int), state


class OnlyOne(Toy):
    def act(self, observation, is_first, state, explore=False):
        return 0, state


class Columns(Toy):
    def act(self, observation, is_first, state, explore=False):
        return np.zeros((len(is_first), 1), dtype=int), state


class Floats(Toy):
    def act(self, observation, is_first, state, explore=False):
        return np.zeros(len(is_first)), state


class Booleans(Toy):
    def act(self, observation, is_first, state, explore=False):
        return is_first, state


class TooHigh(Toy):
    def act(self, observation, is_first, state, explore=False):
        return np.full(len(is_first), 6), state


class Negative(Toy):
    def act(self, observation, is_first, state, explore=False):
        return np.full(len(is_first), -1), state


class Meddler(Toy):
    def act(self, observation, is_first, state, explore=False):
        observation["context"] *= 0.5
        return super().act(observation, is_first, state)


class Normalizer(Toy):
    def act(self, observation, is_first, state, explore=False):
        observation["state"][:, :2] /= 13
        return super().act(observation, is_first, state)


class Unseeded(Toy):
    def act(self, observation, is_first, state, explore=False):
        return np.random.default_rng().integers(6, size=len(is_first)), state


class Stateless(Toy):
    def act(self, observation, is_first, state, explore=False):
        return np.zeros(len(is_first), dtype=int)


class Watcher(Toy):
    def act(self, observation, is_first, state, explore=False):
        is_first[:] = False
        return super().act(observation, is_first, state)


class Continuing(Toy):
    """Counts on where the last episode ended."""

    def act(self, observation, is_first, state, explore=False):
        return state % 6, state + 1


class Numbering(Toy):
    """Takes its slot in the batch for something that it may know."""

    def act(self, observation, is_first, state, explore=False):
        return np.arange(len(is_first)) % 6, state


class OneStream(Toy):
    """Draws for all environments from one generator, which is seeded, but by no episode."""

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        agent = cls()
        agent.rng = np.random.default_rng(seed)
        return agent

    def act(self, observation, is_first, state, explore=False):
        return self.rng.integers(6, size=len(is_first)), state


class OnlyThree(Toy):
    def act(self, observation, is_first, state, explore=False):
        return np.zeros(3, dtype=int), state


class Raising(Toy):
    def act(self, observation, is_first, state, explore=False):
        return observation["map"], state


class Unbuilt(Toy):
    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        cls()


class Unbuildable(Toy):
    @classmethod
    def build(cls, interface):
        return cls()


class BuiltByItself(Toy):
    def build(self, interface, *, seed=0, checkpoint=None):
        return self


class Forgetful(Toy):
    def initial_state(self):
        return None


class Unseedable(Toy):
    def seed_episodes(self, seeds):
        pass


class Sizeless(Toy):
    def context_size(self, size):
        return size


class Words(Toy):
    def act(self, observation, is_first, state, explore=False):
        return ["forward"] * len(is_first), state


class Ragged(Toy):
    def act(self, observation, is_first, state, explore=False):
        return [[0], [0, 1], 0], state


class Motionless:
    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        return cls()

    def initial_state(self, batch_size):
        return None


class TestConformance:
    @pytest.mark.parametrize("name", agent_names())
    def test_agent_when_installed(self, name, tmp_path):
        agent_class, checkpoint = load_agent_class(name), None
        if hasattr(agent_class, "build_learner"):
            # Untrained: the contract does not depend on what it learned.
            interface = Interface("local", 13, getattr(agent_class, "context_size", lambda size: size)(13))
            agent_class.build_learner(interface, load_mazes(13, "train")[:1]).save(tmp_path, {})
            checkpoint = tmp_path / "agent.safetensors"
        check_agent(agent_class, checkpoint=checkpoint)

    def test_agent_when_toy_conforms(self):
        check_agent(Toy)

    @pytest.mark.parametrize(
        ("broken", "message"),
        [
            (OneTooMany, r"expected act\(\) to return 3 actions, one an environment, found shape \(4,\)$"),
            (OnlyOne, r"expected act\(\) to return 3 actions, one an environment, found shape \(\)$"),
            (Columns, r"expected act\(\) to return 3 actions, one an environment, found shape \(3, 1\)$"),
            (OnlyThree, r"expected act\(\) to return 1 actions, one an environment, found shape \(3,\)$"),
            (Floats, r"expected act\(\) to return integer actions, found float64$"),
            (Booleans, r"expected act\(\) to return integer actions, found bool$"),
            (Words, r"expected act\(\) to return integer actions, found <U7$"),
            (Ragged, r"act\(\) raised ValueError: .*inhomogeneous"),
            (TooHigh, r"expected act\(\) to return actions from 0 to 5, found 6$"),
            (Negative, r"expected act\(\) to return actions from 0 to 5, found -1$"),
            (Meddler, r"expected act\(\) to leave observation\['context'\] as it was$"),
            (Normalizer, r"expected act\(\) to leave observation\['state'\] as it was$"),
            (Watcher, r"expected act\(\) to leave is_first as it was$"),
            (Unseeded, r"expected the same actions in an episode when built anew from the same seed, found others; "),
            (Continuing, r"expected the same actions in an episode after another one, found others; begin anew where "),
            (Numbering, r"expected the same actions in an episode in another slot, found others"),
            (OneStream, r"expected the same actions in an episode after another one, .* given to seed_episodes\(\)$"),
            (Stateless, r"expected act\(\) to return \(actions, state\), found "),
            (Raising, r"act\(\) raised KeyError: 'map' \(test_agents\.py:\d+\)$"),
            (Unbuilt, r"expected build\(\) to return an object with initial_state\(\), found NoneType$"),
            (Unbuildable, r"build\(\) raised TypeError: .* unexpected keyword argument 'seed'$"),
            (BuiltByItself, r"expected build\(\) to be a classmethod, found a method of its objects$"),
            (Forgetful, r"initial_state\(\) raised TypeError: .* 1 positional argument but 2 were given$"),
            (Unseedable, r"seed_episodes\(\) raised TypeError: .* 2 positional arguments but 3 were given$"),
            (Sizeless, r"context_size\(\) raised TypeError: .* missing 1 required positional argument"),
            (Motionless, r"expected a class with act\(\), found none$"),
        ],
    )
    def test_agent_when_broken(self, broken, message):
        with pytest.raises(ConformanceError, match=message) as caught:
            check_agent(broken)
        assert str(caught.value).startswith(f"agent '{broken.__name__}': ")
        assert "\n" not in str(caught.value)

    def test_agent_when_it_is_no_class(self):
        with pytest.raises(ConformanceError, match=r"^expected a class, found <.*Toy object at .*>$"):
            check_agent(Toy())


class TestLoading:
    def test_names_when_listed(self):
        assert {"random", "planner", "planner-closed-loop"} <= set(agent_names())
        assert agent_names() == sorted(agent_names())

    @pytest.mark.parametrize("name", agent_names())
    def test_class_when_installed(self, name):
        agent_class = load_agent_class(name)
        assert all(callable(getattr(agent_class, method)) for method in ("build", "initial_state", "act"))

    def test_class_when_unknown(self):
        with pytest.raises(InputError, match=r"^unknown agent 'plannr'; available: .*planner, planner-closed-loop"):
            load_agent_class("plannr")

    def test_class_when_named_by_module(self, tmp_path, monkeypatch):
        (tmp_path / "toy_at_hand.py").write_text(MODULE_AT_HAND)
        monkeypatch.syspath_prepend(tmp_path)
        assert load_agent_class("toy_at_hand:Mine").__name__ == "Mine"

    def test_class_when_module_lies_in_the_working_directory(self, tmp_path, monkeypatch):
        (tmp_path / "toy_in_the_working_directory.py").write_text(MODULE_AT_HAND)
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry not in ("", ".")])
        assert load_agent_class("toy_in_the_working_directory:Mine").__name__ == "Mine"

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            ("no_such_module:Agent", r"^agent 'no_such_module:Agent': expected module:Class .* No module named"),
            ("json:Agent", r"^agent 'json:Agent': expected module:Class .* module 'json' has no attribute 'Agent'$"),
            ("json:loads", r"^agent 'json:loads': expected a class with build, initial_state and act, found no build$"),
            (":Agent", r"^agent ':Agent': expected module:Class"),
            ("json:", r"^agent 'json:': expected module:Class"),
            (":", r"^agent ':': expected module:Class"),
            (".relative:Agent", r"^agent '\.relative:Agent': expected module:Class"),
            ("", r"^unknown agent ''; available: "),
        ],
    )
    def test_class_when_it_cannot_be_loaded(self, name, message):
        with pytest.raises(InputError, match=message):
            load_agent_class(name)


class TestRandom:
    @staticmethod
    def draws(seeds: list[int], agent_seed: int = 0, num_steps: int = 300) -> np.ndarray:
        """`[B, num_steps]`: the actions of episodes that begin together."""
        agent = load_agent_class("random").build(INTERFACE, seed=agent_seed)
        state, actions = agent.initial_state(len(seeds)), []
        is_first = np.ones(len(seeds), dtype=bool)
        agent.seed_episodes(np.array(seeds), is_first)
        for _ in range(num_steps):
            taken, state = agent.act({}, is_first, state)
            actions.append(taken.copy())
        return np.stack(actions, axis=1)

    def test_draws_when_slot_and_batch_size_differ(self):
        alone = self.draws([7])[0]
        for seeds, slot in (([7, 1, 2], 0), ([1, 2, 7], 2), ([5] * 40 + [7], 40)):
            np.testing.assert_array_equal(self.draws(seeds)[slot], alone)

    def test_draws_when_neighbours_begin_anew(self):
        agent = load_agent_class("random").build(INTERFACE)
        state, kept = agent.initial_state(2), []
        agent.seed_episodes(np.array([7, 1]), np.ones(2, dtype=bool))
        for step in range(300):
            if step % 37 == 5:
                agent.seed_episodes(np.array([99, step]), np.array([False, True]))
            actions, state = agent.act({}, np.zeros(2, dtype=bool), state)
            kept.append(actions[0])
        np.testing.assert_array_equal(kept, self.draws([7])[0])

    def test_draws_when_seeds_differ(self):
        first, second = self.draws([7, 8])
        assert (first != second).any()
        assert (first != self.draws([7], agent_seed=1)[0]).any()

    def test_draws_when_counted(self):
        counts = np.bincount(self.draws(list(range(100))).ravel(), minlength=6)
        # Uniform: each of 6 actions 5,000 times of 30,000, with a standard deviation of 65.
        assert np.abs(counts - 5000).max() < 4 * 65


@pytest.mark.parametrize("name", ["planner", "planner-closed-loop"])
def test_planner_when_map_and_position_are_true(name):
    assert success_rate(name, num_mazes=2, distances=range(1, 16), episodes_per_distance=3) == 1.0


@pytest.mark.parametrize(("name", "lowest", "highest"), [("planner", 0.0, 0.8), ("planner-closed-loop", 0.95, 1.0)])
def test_planner_when_position_is_noisy(name, lowest, highest):
    found = success_rate(name, num_mazes=10, distances=range(6, 11), episodes_per_distance=2, position_noise=0.5)
    assert lowest <= found <= highest


@pytest.mark.parametrize("name", ["planner", "planner-closed-loop"])
@pytest.mark.parametrize("perturbation", [{"map_flip": 0.3}, {"map_warp": 0.25}], ids=["map_flip", "map_warp"])
def test_planner_when_map_is_wrong(name, perturbation):
    # It may fail, but it goes on acting, also where start or goal are shown as walls or as one cell.
    assert success_rate(name, num_mazes=10, distances=(1, 5, 9), episodes_per_distance=2, **perturbation) < 1.0


def success_rate(name: str, num_mazes: int, distances, episodes_per_distance: int, **perturbation: float) -> float:
    agent_class = load_agent_class(name)
    spec = make_spec("local", maps=load_mazes(13, "train")[:num_mazes], distances=distances, **perturbation)
    spec = dataclasses.replace(spec, context_size=agent_class.context_size(13))
    trials = select_trials("local", spec.mazes, False, distances, episodes_per_distance)
    agent = agent_class.build(Interface("local", 13, spec.context_size))
    ended = [record for records in run_trials(agent, spec, list(enumerate(trials)), 64) for record in records]
    assert len(ended) == len(trials)
    return float(np.mean([record["success"] for record in ended]))
