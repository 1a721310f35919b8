"""Kinds of actions: velocities on the same actuators, the same in all three environments, and agents of each kind."""

from __future__ import annotations

import json

import dm_env
import gymnasium
import numpy as np
import pytest
import simple_mazes
from dm_env import specs
from gymnasium.utils import env_checker

from mazebench.agent import Agent, SingleAgent
from mazebench.constants import ACTIONS, DISCRETE
from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError, UnplayableError
from mazebench.evaluation.checked_agent import AgentError
from mazebench.evaluation.evaluate import evaluate
from mazebench.maps.benchmark import load_mazes
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task
from mazebench.testing import ConformanceError, check_agent
from mazebench.world.bodies import SLIDER

MIDDLE = Episode(0, (20, 20), (35, 35), 0.0, 0)
# The velocity that stands for each of the six actions.
UNIT_VELOCITIES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
DRAWN = np.random.default_rng(0).integers(6, size=60)
TURNING = np.random.default_rng(0).uniform(-1.2, 1.2, size=(60, 2))


@pytest.fixture(scope="module")
def field() -> Environment:
    return Environment(Task.of(mazes=simple_mazes.field(41), distances=[30], actions="velocity"))


def cruise(field: Environment, velocity, num_steps: int = 12) -> np.ndarray:
    """Forward, left (m/s) and turn rate (rad/s) after driving for some time."""
    field.reset(episode=MIDDLE)
    for _ in range(num_steps):
        state = field.step(np.array(velocity)).observation["state"]
    return state[[6, 7, 11]]


class TestControls:
    def test_unit_velocities_are_the_six_actions(self):
        np.testing.assert_array_equal(SLIDER.velocity_controls(UNIT_VELOCITIES), SLIDER.action_controls())
        np.testing.assert_array_equal(SLIDER.velocity_controls(np.zeros(3)), np.zeros(5))

    @pytest.mark.parametrize("share", [1.0, 0.75, 0.5, 0.25, -0.5, -1.0])
    def test_a_body_cruises_at_its_share_of_the_top_speed(self, field, share):
        np.testing.assert_allclose(cruise(field, [share, 0, 0]), [share * SLIDER.top_speed, 0, 0], atol=1e-3)
        np.testing.assert_allclose(cruise(field, [0, share, 0]), [0, share * SLIDER.top_speed, 0], atol=1e-3)
        np.testing.assert_allclose(cruise(field, [0, 0, share]), [0, 0, share * SLIDER.turn_rate], atol=1e-3)

    def test_a_body_driving_aslant_is_no_faster(self, field):
        forward, left, _ = cruise(field, [1, 1, 0])
        assert (forward, left) == pytest.approx((SLIDER.top_speed / np.sqrt(2),) * 2, abs=1e-3)
        forward, left, _ = cruise(field, [-0.3, 0.4, 0])
        assert (forward, left) == pytest.approx((-0.3 * SLIDER.top_speed, 0.4 * SLIDER.top_speed), abs=1e-3)

    def test_no_velocity_drives_a_body_into_a_wall(self):
        spec = Task.of("local", size=13, actions="velocity")
        envs, rng = MazeVectorEnv(spec, 32, seed=0), np.random.default_rng(0)
        envs.reset(seed=0)
        for step in range(120):
            if step % 6 == 0:
                actions = rng.uniform(-1, 1, size=(32, 3))
            _, _, _, _, info = envs.step(actions)
            for maze, position in zip(info["maze"], info["position"], strict=True):
                assert simple_mazes.clearance(spec.mazes[maze].walls, position[None]) > SLIDER.radius - 0.01


class TestEnvironments:
    @pytest.mark.parametrize(("kind", "size"), [("velocity", 3), ("diff", 2)])
    def test_all_environments_declare_continuous_actions(self, kind, size):
        task = Task.of(actions=kind)
        assert Environment(task).action_spec() == specs.BoundedArray((size,), np.float32, -1.0, 1.0, name="action")
        assert MazeEnv(task).action_space == gymnasium.spaces.Box(-1.0, 1.0, (size,), np.float32)
        assert MazeVectorEnv(task, 2).action_space.shape == (2, size)

    @pytest.mark.parametrize(
        ("kind", "actions", "other_kind", "same_actions"),
        [
            ("velocity", UNIT_VELOCITIES[DRAWN], "six", DRAWN),
            ("four", DRAWN % 4, "six", [ACTIONS.index(DISCRETE["four"][action]) for action in DRAWN % 4]),
            ("diff", TURNING, "velocity", np.insert(TURNING, 1, 0.0, axis=1)),
        ],
    )
    def test_kinds_play_the_same_episode_where_they_have_the_same_actions(
        self, kind, actions, other_kind, same_actions
    ):
        one, other = (MazeEnv(Task.of(actions=each)) for each in (kind, other_kind))
        np.testing.assert_equal(one.reset(seed=5), other.reset(seed=5))
        for action, same in zip(actions, same_actions, strict=True):
            np.testing.assert_equal(one.step(action), other.step(same))

    def test_four_have_no_strafing(self):
        env = MazeEnv(Task.of(actions="four"))
        env.reset(seed=5)
        assert env.action_space.n == 4
        with pytest.raises(InputError, match=r"from 0 to 3 \(forward, backward, look_left, look_right\), found 4"):
            env.step(4)

    @pytest.mark.parametrize(("kind", "size"), [("velocity", 3), ("diff", 2)])
    def test_steps_are_the_same_in_all_environments(self, kind, size):
        spec = Task.of(mazes=load_mazes(13, "train")[:2], actions=kind, time_limit=30)
        actions = np.random.default_rng(0).uniform(-1, 1, size=(20, 2, size)).astype(np.float32)
        envs = MazeVectorEnv(spec, 2)
        seen = [envs.reset(seed=[4, 9])[0]["state"]] + [envs.step(action)[0]["state"] for action in actions]
        for slot, seed in enumerate((4, 9)):
            env, dm = MazeEnv(spec), Environment(spec)
            states = [env.reset(seed=seed)[0]["state"]] + [env.step(action)[0]["state"] for action in actions[:, slot]]
            steps = [dm.reset(seed=seed)] + [dm.step(action) for action in actions[:, slot]]
            np.testing.assert_array_equal(states, [states[slot] for states in seen])
            np.testing.assert_array_equal(states, [step.observation["state"] for step in steps])
            assert steps[0].step_type is dm_env.StepType.FIRST

    @pytest.mark.filterwarnings("ignore::UserWarning")
    def test_continuous_environments_pass_the_checks(self):
        env_checker.check_env(MazeEnv(Task.of(actions="velocity")), skip_render_check=True)

    def test_velocities_are_clipped(self, field):
        np.testing.assert_array_equal(cruise(field, [2, 0, -7], 3), cruise(field, [1, 0, -1], 3))


class Homing(SingleAgent):
    """Turns to the goal, and drives the faster, the less it has to turn."""

    plays_actions = ("diff", "velocity")

    def act(self, observation):
        size = observation["context"].shape[-1]
        row, column = divmod(int(observation["context"][2].argmax()), size)
        x, y = observation["state"][:2]
        bearing = np.arctan2(size - row - 0.5 - y, column + 0.5 - x) - observation["state"][5]
        bearing = (bearing + np.pi) % (2 * np.pi) - np.pi
        return np.array([max(0.0, np.cos(bearing)), np.clip(bearing, -1, 1)])


class Batch(Agent):
    plays_actions = ("velocity",)
    answer = np.zeros(3)

    def act(self, inputs, state, explore=False):
        return np.tile(self.answer, (len(inputs.seed), 1)), state


class Planar(Batch):
    answer = np.zeros(2)


class Lost(Batch):
    answer = np.full(3, np.nan)


class TestAgents:
    @pytest.fixture
    def near(self, tmp_path):
        return {"out": tmp_path / "out", "kinds": "dfs", "num_mazes": 2, "distances": (1,), "episodes_per_distance": 2}

    def test_an_agent_without_the_six_has_actions_of_its_own(self, near):
        summary = evaluate(f"{__name__}:Homing", **near)
        assert summary.task.actions == "diff"
        assert summary.who == f"{__name__}:Homing with diff actions"
        assert summary.overall.success_rate == 1

    def test_an_agent_of_several_kinds_plays_the_one_that_is_asked_for(self, near):
        assert evaluate("random", **near).who == "random"
        near["out"] = near["out"].with_name("diff")
        assert evaluate("random", **near, actions="diff").who == "random with diff actions"

    @pytest.mark.parametrize("agent", ["planner", "oracle"])
    def test_an_agent_of_the_six_says_so(self, near, agent):
        with pytest.raises(UnplayableError, match=f"^agent '{agent}': plays the actions six, found diff$"):
            evaluate(agent, **near, actions="diff")

    @pytest.mark.parametrize("agent", ["navigator", "planner-closed-loop"])
    def test_robots_reach_the_goal_without_strafing(self, near, agent):
        near["distances"] = (5,)
        found = {}
        for kind in ("four", "diff", "six", "velocity"):
            near["out"] = near["out"].with_name(kind)
            summary = evaluate(agent, **near, actions=kind)
            assert summary.overall.success_rate == 1
            lines = (near["out"] / "episodes.jsonl").read_text().splitlines()
            found[kind] = [(episode["steps"], episode["path_length"]) for episode in map(json.loads, lines)]
        assert found["four"] == found["diff"]
        assert found["six"] == found["velocity"]
        assert found["six"] != found["diff"]

    @pytest.mark.parametrize(
        ("name", "said"),
        [
            ("Planar", r"expected velocities \(.*\) of shape \(4, 3\) from act\(\), found float64 of shape \(4, 2\)"),
            ("Lost", r"expected finite velocities .* found nan"),
        ],
    )
    def test_wrong_velocities_are_named_in_one_line(self, near, name, said):
        with pytest.raises(AgentError, match=f"^agent '{__name__}:{name}': {said}$"):
            evaluate(f"{__name__}:{name}", **near)

    def test_agents_are_checked_with_their_first_kind(self):
        check_agent(Homing)
        check_agent(Batch)
        with pytest.raises(ConformanceError, match=r"of shape \(3, 3\) from act\(\), found float64 of shape \(3, 2\)"):
            check_agent(Planar)
