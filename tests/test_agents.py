"""Agents: how they are found, the check of their contract, and what the ones without a network can do."""

from __future__ import annotations

import dataclasses
import itertools
import sys

import numpy as np
import pytest
from acting import inputs_of
from mazebench_agents.robot.cells import start_cell
from run_folders import IMPORTS

from mazebench.agent import Agent, Inputs, Interface, SingleAgent, Truth, as_agent_class
from mazebench.agent_loading import agent_names, load_agent_class
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError, UnplayableError
from mazebench.evaluation.checked_agent import CheckedAgent
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import build_agent, make_plan
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.kinds import generate
from mazebench.rollout import rollout
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials
from mazebench.testing import ConformanceError, check_agent
from mazebench.training.protocol import LearningAgent

INTERFACE = Interface("local", 13, 13)


class Counting(Agent):
    """A conforming agent to break: counts its steps in each slot."""

    def initial_state(self, batch_size):
        return np.zeros(batch_size, dtype=int)

    def act(self, inputs, state, explore=False):
        state = np.where(inputs.new_episode, 0, state)
        return state % 6, state + 1


class CountingAlone(SingleAgent):
    """The same for one environment."""

    def reset(self, observation):
        if self.new_episode:
            self.count = -1

    def act(self, observation):
        self.count += 1
        return self.count % 6


class Drawing(Agent):
    """A conforming agent that draws."""

    def initial_state(self, batch_size):
        return [None] * batch_size

    def act(self, inputs, state, explore=False):
        for slot in np.flatnonzero(inputs.new_episode):
            state[slot] = np.random.default_rng(inputs.seed[slot])
        return np.array([rng.integers(6) for rng in state]), state


class Sensing(SingleAgent):
    """Drives forward unless a wall is near, which the lidar says."""

    needs_sensors = ("lidar",)

    def act(self, observation):
        return 0 if observation["lidar"][0] > 0.5 else 4


class DrawsOnSelf(Counting):
    """Keeps a generator on itself, where batches that are played by turns share it."""

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        agent = cls()
        agent.rng = np.random.default_rng(seed)
        return agent

    def act(self, inputs, state, explore=False):
        return self.rng.integers(6, size=len(inputs.seed)), state


def acting(act) -> type[Agent]:
    """`Counting` with another act(), which is called without `self` and `explore`."""
    return type("Broken", (Counting,), {"act": lambda self, inputs, state, explore=False: act(inputs, state)})


def halve_the_map(inputs, state):
    inputs.observation["context"] *= 0.5
    return np.zeros(len(inputs.seed), dtype=int), state


SAME = r"expected the same actions in an episode "
BROKEN = {
    "float actions": (
        acting(lambda inputs, state: (np.zeros(len(inputs.seed)), state)),
        r"expected 3 integer actions from act\(\), found float64 of shape \(3,\)$",
    ),
    "out of range": (
        acting(lambda inputs, state: (np.full(len(inputs.seed), 6), state)),
        r"expected actions from 0 to 5 from act\(\), found 6$",
    ),
    "changes inputs": (acting(halve_the_map), r"expected act\(\) to leave its inputs; change a copy$"),
    "global generator": (
        acting(lambda inputs, state: (np.random.default_rng().integers(6, size=len(inputs.seed)), state)),
        SAME + "when built anew",
    ),
    "generator on self": (DrawsOnSelf, SAME + "when another batch is played by turns"),
    "counts on": (acting(lambda inputs, state: (state % 6, state + 1)), SAME + "after another episode"),
    "slot": (acting(lambda inputs, state: (np.arange(len(inputs.seed)), state)), SAME),
    "batch size": (acting(lambda inputs, state: (np.full(len(inputs.seed), len(inputs.seed)), state)), SAME + "alone"),
    "raises": (
        acting(lambda inputs, state: (inputs.observation["map"], state)),
        r"act\(\) raised KeyError: 'map' \(test_agents\.py:\d+\)$",
    ),
    "no agent": (object, r"expected a subclass of mazebench\.Agent or SingleAgent, found <class 'object'>$"),
}


ALONE = [name for name in agent_names() if name not in ("llm", "person")]  # which ask somebody


class TestConformance:
    @pytest.mark.parametrize("name", ALONE)
    def test_installed_agent_conforms(self, name, tmp_path):
        agent_class, checkpoint = load_agent_class(name), None
        if issubclass(agent_class, LearningAgent):
            # Untrained: the contract does not depend on what it learned.
            mazes = (generate("dfs", 7, np.random.default_rng(0), "m"),)
            needed = {"context_size": agent_class.context_size(7), "sensors": agent_class.needs_sensors}
            task = Task.of(mazes=mazes, distances=(1, 2, 3), **needed)
            agent_class.build_learner(task).save(tmp_path, {})
            checkpoint = tmp_path / "agent.safetensors"
        check_agent(agent_class, checkpoint=checkpoint)

    @pytest.mark.parametrize("agent_class", [Counting, CountingAlone, Drawing, Sensing])
    def test_conforming_agent_passes(self, agent_class):
        check_agent(agent_class)
        check_agent(agent_class, Task.of("local", fresh=True))

    def test_an_agent_is_built_for_the_task_that_is_named(self):
        found = []

        class Built(Counting):
            @classmethod
            def build(cls, interface, *, seed=0, checkpoint=None):
                found.append(interface)
                return cls()

            def act(self, inputs, state, explore=False):
                assert inputs.observation["context"].shape[-1] == interface.context_size
                return super().act(inputs, state, explore)

        interface = Task.of("adrift", level=3).interface
        check_agent(Built, "adrift", level=3)
        assert set(found) == {interface}

    def test_options_belong_to_the_name_of_a_task(self):
        with pytest.raises(InputError, match="expected no options beside a TaskOptions, found level"):
            check_agent(Counting, level=3)

    @pytest.mark.parametrize(("broken", "message"), BROKEN.values(), ids=BROKEN)
    def test_fault_is_named_in_one_line(self, broken, message):
        with pytest.raises(ConformanceError, match=rf"^agent '{broken.__name__}': .*{message}"):
            check_agent(broken)


class TestSingleAgent:
    def test_each_episode_is_played_by_a_fresh_copy(self):
        agent_class = as_agent_class(CountingAlone)
        agent = agent_class.build(INTERFACE)
        state, observation = agent.initial_state(2), {"state": np.zeros((2, 12))}
        taken = []
        for new_episode in ([True, True], [False, False], [False, True], [False, False]):
            mask = np.array(new_episode)
            actions, state = agent.act(inputs_of(observation, mask), state)
            taken.append(actions.tolist())
        assert taken == [[0, 0], [1, 1], [2, 0], [3, 1]]

    def test_agent_is_given_what_concerns_its_environment(self):
        given = []

        class Listening(SingleAgent):
            needs_truth = True
            needs_sensors = ("lidar",)
            learns = True

            @classmethod
            def context_size(cls, size):
                return 2 * size

            def reset(self, observation):
                given.append(("reset", self.seed, self.new_episode, self.truth.goal.tolist()))

            def act(self, observation):
                given.append(("act", float(observation["state"]), self.new_episode))
                return 0

        agent_class = as_agent_class(Listening)
        assert agent_class.needs_truth
        assert agent_class.learns
        assert agent_class.needs_sensors == ("lidar",)
        assert agent_class.context_size(13) == 26
        assert agent_class.default_checkpoint() is None
        assert agent_class.__name__ == "Listening"
        truth = Truth(np.zeros((2, 3, 3), dtype=bool), np.zeros((2, 3)), np.array([[1, 1], [2, 2]]))
        new_episode, new_context = np.array([True, True]), np.array([True, True])
        agent = agent_class.build(INTERFACE)
        seeds, observation = np.array([7, 8]), {"state": np.array([0.5, 1.5])}
        state = agent.initial_state(2)
        _, state = agent.act(Inputs(observation, new_episode, new_context, seeds, truth), state)
        agent.act(Inputs(observation, ~new_episode, np.array([False, True]), seeds, truth), state)
        assert given == [
            ("reset", 7, True, [1, 1]), ("act", 0.5, True), ("reset", 8, True, [2, 2]), ("act", 1.5, True),
            ("act", 0.5, False), ("reset", 8, False, [2, 2]), ("act", 1.5, False),
        ]  # fmt: skip


class TestLoading:
    def test_a_module_in_the_working_directory_is_found(self, tmp_path, monkeypatch):
        code = "class Mine(SingleAgent):\n    def act(self, observation):\n        return 0\n"
        (tmp_path / "agent_in_the_working_directory.py").write_text(IMPORTS + code)
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry not in ("", ".")])
        agent_class = load_agent_class("agent_in_the_working_directory:Mine")
        assert issubclass(agent_class, Agent)
        assert agent_class.__name__ == "Mine"

    @pytest.mark.parametrize(
        ("name", "message"),
        [
            (
                "plannr",
                r"^unknown agent 'plannr'; available: .*planner, planner-closed-loop.*; .* named as module:Class$",
            ),
            ("no_such_module:Agent", r"^agent 'no_such_module:Agent' can't be imported: ModuleNotFoundError: "),
            ("json:JSONDecoder", r"^agent 'json:JSONDecoder': expected a subclass of "),
            ("agents/mine.py:Agent", r"^agent 'agents/mine.py:Agent'; expected module:Class"),
        ],
    )
    def test_a_name_that_leads_to_no_agent_is_refused(self, name, message):
        with pytest.raises(InputError, match=message):
            load_agent_class(name)


def test_the_random_agent_draws_by_the_episodes_seed():
    agent = load_agent_class("random").build(INTERFACE)
    state, first, taken = agent.initial_state(3), np.ones(3, dtype=bool), []
    for new in (first, *[~first] * 50):
        actions, state = agent.act(Inputs({}, new, new, np.array([7, 8, 7])), state)
        taken.append(actions)
    one, other, same = np.transpose(taken)
    np.testing.assert_array_equal(one, same)
    assert (one != other).any()


class TestPlanners:
    @pytest.mark.parametrize("name", ["planner", "planner-closed-loop"])
    def test_planner_reaches_all_goals_where_map_and_position_are_true(self, name):
        assert success_rate(name, num_mazes=2, distances=range(1, 16), episodes_per_distance=3) == 1.0

    @pytest.mark.parametrize(("name", "lowest", "highest"), [("planner", 0.0, 0.8), ("planner-closed-loop", 0.95, 1.0)])
    def test_only_the_closed_loop_planner_copes_with_position_noise(self, name, lowest, highest):
        found = success_rate(name, num_mazes=5, distances=range(6, 11), episodes_per_distance=2, position_noise=0.5)
        assert lowest <= found <= highest

    def test_the_closed_loop_planner_knows_the_scale_of_a_finer_map(self):
        found = success_rate("planner-closed-loop", 3, range(2, 16, 4), episodes_per_distance=2, context_size=26)
        assert found == 1.0

    def test_without_a_mark_the_start_is_the_free_cell_nearest_to_the_middle(self):
        context = np.zeros((4, 5, 5), dtype=np.float32)
        context[0] = 1
        context[0, 1, 1:4] = context[0, 1:4, 3] = 0  # free are a corridor's cells (1, 1) to (1, 3) and (3, 3)
        assert start_cell(context) == (1, 2)
        context[3, 3, 3] = 1
        assert start_cell(context) == (3, 3)

    def test_oracle_reaches_all_goals_whatever_is_wrong_with_the_map_and_the_senses(self):
        perturbation = {"map_flip": 0.2, "position_noise": 1.0}
        assert success_rate("oracle", 5, range(1, 16, 2), episodes_per_distance=2, **perturbation) == 1.0
        assert success_rate("oracle", 5, range(1, 16, 2), episodes_per_distance=2, map_warp=0.25) == 1.0


OF_ONE_SIZE = ("mmn", "mah-paper")  # agents whose code of a context has a fixed size


class Small(Counting):
    """Asks for the same map whatever the size of the mazes is."""

    @classmethod
    def context_size(cls, size):
        return 31


class TestTracks:
    def test_an_agent_that_asks_for_one_size_is_refused_where_a_track_shows_another(self):
        plan = make_plan(eval_options("mine:Small", task="building"), Small)
        assert build_agent(plan.options, plan.task, Small).name == "mine:Small"
        plan = make_plan(eval_options("mine:Small", task="rough"), Small)
        message = r"context_size\(\) asks for maps of 31 x 31 only; the track 'rough' shows 62 x 62$"
        with pytest.raises(UnplayableError, match=message):
            build_agent(plan.options, plan.task, Small)

    def test_a_track_that_shows_another_map_than_asked_for_is_remarked(self):
        remark = "navigator asks for a map of 31 x 31; the track 'rough' shows 62 x 62 to all agents"
        assert make_plan(eval_options("navigator", task="rough")).remark == remark
        assert make_plan(eval_options("navigator", task="building")).remark is None
        assert make_plan(eval_options("random", task="rough")).remark is None

    @pytest.mark.parametrize(
        ("name", "options", "said"),
        [
            ("dqn", {"task": "building"}, []),
            ("dqn", {"task": "building", "sensors": "lidar"}, []),
            ("dqn", {"task": "building", "sensors": "lidar,egocentric"}, ["reads no sensors, found egocentric"]),
            ("mah", {"sensors": "lidar,labels"}, ["reads no sensors, found lidar, labels"]),
            ("planner", {"sensors": "depth"}, ["reads no sensors, found depth"]),
            ("navigator", {"sensors": "egocentric"}, []),
            ("navigator", {"sensors": "egocentric,lidar"}, ["reads lidar, found egocentric"]),
            ("neural-planner", {"task": "rebuilt", "sensors": "egocentric,depth"}, ["reads egocentric, found depth"]),
            ("map-policy", {"task": "building"}, []),
            ("map-policy", {"sensors": "egocentric,labels"}, ["reads egocentric, found labels"]),
        ],
    )
    def test_sensors_that_an_agent_does_not_read_are_said(self, name, options, said, remarks):
        make_plan(eval_options(name, **options)).say_remarks(of_maps=False)
        assert remarks() == [f"agent {name!r}: {each}" for each in said]

    @pytest.mark.parametrize("name", ALONE)
    @pytest.mark.parametrize(
        "options",
        [{"task": "rough", "level": 3}, {"size": 13, "context_size": 26}],
        ids=["rough", "finer map"],
    )
    def test_every_agent_acts_or_says_that_it_serves_one_size(self, name, options):
        agent_class = load_agent_class(name)
        options = {"sensors": agent_class.needs_sensors} | options if "size" in options else options
        kinds = agent_class.plays_actions
        spec = Task.of(**options, actions=None if "six" in kinds else kinds[0])
        needs_pose = name in ("costmap-dwa", "neural-mapper") and "size" not in options
        if name.startswith("llm") or name in ("map-policy", "navigator-told") or needs_pose:
            with pytest.raises(
                UnplayableError,
                match=r"expected (the building's|maps with a pixel per cell|the sensor|a map that lies|the pose)",
            ):
                act_for_three_steps(name, spec)
        elif name in OF_ONE_SIZE and spec.context_size != 13:
            with pytest.raises(UnplayableError, match=r"reads maps of 13 x 13 only, found .* mah and mmn-paths read"):
                act_for_three_steps(name, spec)
        else:
            assert act_for_three_steps(name, spec) == 3


def act_for_three_steps(name: str, spec: Task) -> int:
    """Returns how many steps were taken, of a run of which all actions are checked."""
    agent_class = load_agent_class(name)
    interface = spec.interface
    agent = CheckedAgent(name, agent_class.build(interface), interface.actions)
    env = MazeVectorEnv(spec, 2, num_threads=1)
    steps = rollout(agent, env, env.reset(seed=0), np.zeros_like, needs_truth=agent_class.needs_truth)
    *_, last = itertools.islice(steps, 3)
    return int(last.next_info["steps"][0])


def success_rate(
    name: str, num_mazes: int, distances, episodes_per_distance: int, context_size: int = 13, **perturbation: float
) -> float:
    agent_class = load_agent_class(name)
    spec = Task.of("local", mazes=load_mazes(13, "train")[:num_mazes], distances=distances, **perturbation)
    spec = dataclasses.replace(spec, context_size=context_size)
    trials = dict(enumerate(draw_trials(spec, episodes_per_distance)))
    agent = agent_class.build(Interface("local", 13, spec.context_size))
    played = run_trials(agent, spec, trials, 64, needs_truth=agent_class.needs_truth)
    ended = [result for results in played for result in results]
    assert len(ended) == len(trials)
    return float(np.mean([result.success for result in ended]))
