"""The Gymnasium environment: its registration, and what Gymnasium's own rules ask of it."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.envs import registration
from gymnasium.utils import env_checker

from mazebench.envs.gym import MazeEnv
from mazebench.envs.registration import register_environments
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.generators import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.episode import Episode
from mazebench.tasks.registry import make_spec

TITLES = ("Local", "Hierarchical", "LocalGoal")
IDS = [f"mazebench/{title}-{size}-v1" for title in TITLES for size in (13, 15, 17, 19, 21)]
FORWARD, LOOK_LEFT = 0, 4
PROBE_FAILED = 77
OPEN_EGL = f"""
import sys
try:
    import mujoco
    mujoco.GLContext(64, 64).free()
except (RuntimeError, ImportError, AttributeError):
    sys.exit({PROBE_FAILED})
"""


@pytest.fixture(scope="module", autouse=True)
def _registered():
    """The ids, wherever Gymnasium did not find them by itself."""
    if not set(IDS) <= set(registration.registry):
        with registration.namespace("mazebench"):
            register_environments()


def corridor_env(**options) -> MazeEnv:
    """A corridor of 7 cells, from (1, 1) to (1, 7) of 9 x 9."""
    walls = np.ones((9, 9), dtype=bool)
    walls[1, 1:8] = False
    return MazeEnv(make_spec(maps=Maze(walls), **options))


def random_env(task: str, **options) -> MazeEnv:
    """In mazes so small that random actions reach the goal now and then."""
    rng = np.random.default_rng(0)
    return MazeEnv(make_spec(task, maps=[generate("obstacles", 6, rng) for _ in range(3)], **options))


def run(program: str, **variables: str) -> None:
    environment = os.environ | variables
    result = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True)
    if result.returncode == PROBE_FAILED:
        pytest.skip("EGL is not usable here")
    assert result.returncode == 0, result.stderr


class TestRegistration:
    @pytest.mark.parametrize("task", ["Local", "Hierarchical"])
    def test_make_when_mazebench_was_not_imported(self, task):
        run(
            "import gymnasium\n"
            f"env = gymnasium.make('mazebench:mazebench/{task}-13-v1')\n"
            "observation, info = env.reset(seed=0)\n"
            "assert observation['state'].shape == (12,)"
        )

    def test_make_when_mazebench_was_imported_first(self):
        run("import mazebench\nimport gymnasium\ngymnasium.make('mazebench/Local-13-v1').reset(seed=0)")

    def test_ids_when_listed(self):
        assert {name for name in registration.registry if name.startswith("mazebench/")} == set(IDS)

    @pytest.mark.parametrize("name", IDS)
    def test_spec_when_looked_up(self, name):
        spec = gymnasium.spec(name)
        assert spec.max_episode_steps is None
        title, size = name.removeprefix("mazebench/").split("-")[:2]
        task_spec = gymnasium.make(name).unwrapped.task_spec
        assert (task_spec.task, task_spec.size) == (title.removesuffix("Goal").lower(), int(size))

    def test_make_when_given_options(self):
        env = gymnasium.make("mazebench/Local-13-v1", split="eval", distances=[7], context_size=9, seed=3)
        spec = env.unwrapped.task_spec
        assert (spec.mazes[0].name, spec.distances, spec.context_size) == ("13-eval-00", (7,), 9)
        first, again = env.reset()[0], env.reset(seed=3)[0]
        np.testing.assert_array_equal(first["state"], again["state"])

    def test_make_vec_when_called(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            envs = gymnasium.make_vec("mazebench/Local-13-v1", num_envs=3)
            observations, _ = envs.reset(seed=0)
            envs.step(envs.action_space.sample())
            envs.close()
        assert isinstance(envs, MazeVectorEnv)
        assert observations["context"].shape == (3, 4, 13, 13)

    def test_make_vec_when_synchronous(self):
        envs = gymnasium.make_vec("mazebench/Local-13-v1", num_envs=2, vectorization_mode="sync")
        assert isinstance(envs, gymnasium.vector.SyncVectorEnv)
        ours = gymnasium.make_vec("mazebench/Local-13-v1", num_envs=2)
        for key in ("state", "context"):
            np.testing.assert_array_equal(envs.reset(seed=5)[0][key], ours.reset(seed=5)[0][key])


# Both checkers doubt what is meant: a state without bounds, a context that is no picture.
@pytest.mark.filterwarnings("ignore::UserWarning")
class TestCheckers:
    @pytest.mark.parametrize("name", ["mazebench/Local-13-v1", "mazebench/Hierarchical-13-v1"])
    def test_environment_when_checked_by_gymnasium(self, name):
        env_checker.check_env(gymnasium.make(name).unwrapped, skip_render_check=True)

    @pytest.mark.parametrize("name", ["mazebench/Local-13-v1", "mazebench/Hierarchical-13-v1"])
    def test_environment_when_checked_by_stable_baselines(self, name):
        checker = pytest.importorskip("stable_baselines3.common.env_checker")
        checker.check_env(gymnasium.make(name).unwrapped)

    @pytest.mark.parametrize("task", ["local", "hierarchical"])
    def test_environment_when_perturbed(self, task):
        env = random_env(task, map_flip=0.1, map_warp=0.1, position_noise=0.5, context_size=5, distances=[1, 2])
        env_checker.check_env(env, skip_render_check=True)


class TestSteps:
    def test_step_when_not_reset(self):
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            corridor_env().step(FORWARD)
        with pytest.raises(gymnasium.error.ResetNeeded):
            gymnasium.make("mazebench/Local-13-v1").step(FORWARD)

    def test_step_when_episode_has_ended(self):
        env = corridor_env(time_limit=1)
        env.reset(seed=0)
        env.step(LOOK_LEFT)
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            env.step(LOOK_LEFT)
        env.reset()
        env.step(LOOK_LEFT)

    @pytest.mark.parametrize(
        ("time_limit", "expected"), [(5, (-1.0, False, True)), (6, (0.0, True, False)), (7, (0.0, True, False))]
    )
    def test_flags_when_goal_is_six_steps_away(self, time_limit, expected):
        # On the very limit it is a termination, not a truncation.
        env = corridor_env(time_limit=time_limit)
        env.reset(options={"episode": Episode(0, (1, 1), (1, 4), 0.0, 0)})
        for _ in range(min(time_limit, 6) - 1):
            assert env.step(FORWARD)[1:4] == (-1.0, False, False)
        assert env.step(FORWARD)[1:4] == expected

    @pytest.mark.parametrize("task", ["local", "hierarchical"])
    def test_flags_when_many_episodes_end(self, task):
        env = random_env(task, distances=[1, 2], time_limit=20)
        rng = np.random.default_rng(0)
        ends = set()
        for episode in range(30):
            env.reset(seed=episode)
            terminated = truncated = False
            while not (terminated or truncated):
                action = FORWARD if rng.random() < 0.5 else int(rng.integers(6))
                _, reward, terminated, truncated, info = env.step(action)
                assert type(terminated) is type(truncated) is bool
                assert info["success"] == terminated
                assert reward == (0.0 if terminated else -1.0)
            assert terminated != truncated
            ends.add(terminated)
        assert ends == {True, False}

    def test_info_when_driving(self):
        env = corridor_env()
        _, info = env.reset(options={"episode": Episode(0, (1, 1), (1, 4), 0.0, 0)})
        assert info.keys() == {"is_first", "success", "steps", "path_length", "position", "maze", "landmark"}
        assert (info["is_first"], info["steps"], info["path_length"], info["landmark"]) == (True, 0, 0.0, 0)
        np.testing.assert_allclose(info["position"], (1.5, 7.5))
        _, _, _, _, info = env.step(FORWARD)
        assert (info["is_first"], info["success"], info["steps"]) == (False, False, 1)
        assert info["path_length"] == pytest.approx(info["position"][0] - 1.5, abs=1e-9)

    def test_info_when_landmarks_switch(self):
        # From (1, 7) to (1, 1): landmarks at columns 5 and 3, each given up after 2 steps.
        walls = np.ones((9, 9), dtype=bool)
        walls[1, 1:8] = False
        env = MazeEnv(make_spec("hierarchical", maps=Maze(walls), landmark_distance=2, time_limit=2))
        infos = [env.reset(seed=0)[1]] + [env.step(LOOK_LEFT)[-1] for _ in range(6)]
        assert [info["is_first"] for info in infos] == [True, False, True, False, True, False, False]
        assert [info["landmark"] for info in infos] == [0, 0, 1, 1, 2, 2, 2]

    @pytest.mark.parametrize("action", [-1, 6, 0.5])
    def test_action_when_invalid(self, action):
        env = corridor_env()
        env.reset(seed=0)
        with pytest.raises(ValueError, match="expected an action from 0 to 5"):
            env.step(action)

    def test_options_when_episode_is_none(self):
        with pytest.raises(ValueError, match=r"expected options\['episode'\] to be an Episode, found tuple"):
            corridor_env().reset(options={"episode": (1, 1)})


class TestRendering:
    def test_picture_when_no_mode_was_chosen(self):
        env = corridor_env()
        env.reset(seed=0)
        assert env.render() is None

    def test_pictures_when_two_environments_render(self):
        run(
            OPEN_EGL
            + """
import gymnasium, numpy as np
from gymnasium.envs import registration
from mazebench.envs.registration import register_environments
if "mazebench/Local-13-v1" not in registration.registry:
    with registration.namespace("mazebench"):
        register_environments()
envs = [gymnasium.make("mazebench/Local-13-v1", render_mode="rgb_array") for _ in range(2)]
first, second = (env.reset(seed=seed) and env.render() for seed, env in enumerate(envs))
for picture in (first, second):
    assert picture.shape == (480, 480, 3) and picture.dtype == np.uint8
    assert picture.std() > 10, "a picture is black"
assert not np.array_equal(first, second)
np.testing.assert_array_equal(envs[0].render(), first)
envs[0].reset(seed=1)
np.testing.assert_array_equal(envs[0].render(), second)
for env in envs:
    env.close()
""",
            MUJOCO_GL="egl",
        )

    def test_pictures_when_vector_environment_renders(self):
        run(
            OPEN_EGL
            + """
import numpy as np
from mazebench.envs.registration import make_env, make_vec
envs = make_vec("local", 2, size=13, render_mode="rgb_array")
envs.reset(seed=0)
pictures = envs.render()
assert len(pictures) == 2
for seed, picture in enumerate(pictures):
    env = make_env("local", size=13, render_mode="rgb_array")
    env.reset(seed=seed)
    assert np.abs(env.render().astype(int) - picture).mean() < 1, "not the picture of the single environment"
    env.close()
""",
            MUJOCO_GL="egl",
        )
