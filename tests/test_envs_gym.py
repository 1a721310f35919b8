"""The Gymnasium environment: its registration, and what Gymnasium's own rules ask of it."""

from __future__ import annotations

import dataclasses
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.envs import registration
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import env_checker
from gymnasium.vector import AutoresetMode
from processes import run_python, run_with_egl
from simple_mazes import corridor

from mazebench.envs.gym import MazeEnv
from mazebench.envs.registration import register_environments
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError, UnknownOptionError
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.maps.text import write_text_maze
from mazebench.tasks.task import Task
from mazebench.tasks.tracks import TRACKS

TITLES = ("Local", "Hierarchical", "LocalGoal")
IDS = [f"mazebench/{title}-{size}-v1" for title in TITLES for size in (13, 15, 17, 19, 21)]
TRACK_IDS = [f"mazebench/{name.title()}-v1" for name in TRACKS]
FORWARD, LOOK_LEFT = 0, 4


@pytest.fixture(scope="module", autouse=True)
def _registered():
    """The ids, wherever Gymnasium did not find them by itself."""
    if not set(IDS) <= set(registration.registry):
        with registration.namespace("mazebench"):
            register_environments()


def corridor_env(**options) -> MazeEnv:
    return MazeEnv(Task.of(mazes=corridor(), **options))


def test_it_steps_without_dm_control():
    program = (
        "import sys; sys.modules['dm_control'] = None\nimport gymnasium, mazebench\n"
        "env = gymnasium.make('mazebench/Local-13-v1'); env.reset(seed=0); env.step(0); print('done')"
    )
    assert run_python("-c", program).stdout == "done\n"


class TestRegistration:
    @pytest.mark.parametrize(("name", "size"), [("Local-13", 13), ("LocalGoal-13", 13), ("Building", 31)])
    def test_the_size_of_an_id_yields_to_maps_and_to_a_size(self, name, size):
        name = f"mazebench/{name}-v1"
        maze = generate("dfs", 51, np.random.default_rng(0))
        assert gymnasium.make(name, mazes=maze, distances=[40]).unwrapped.task.mazes == (maze,)
        assert gymnasium.make(name).unwrapped.task.size == size
        with pytest.raises(InputError, match="expected mazes of size 15, found size 51"):
            gymnasium.make(name, mazes=maze, size=15)

    def test_an_unknown_option_is_refused_with_all_there_are(self):
        for make, own in ((gymnasium.make, "camera, "), (gymnasium.make_vec, "num_envs, ")):
            message = f"unexpected keyword argument 'mapz'; available: .*{own}"
            with pytest.raises(UnknownOptionError, match=message) as caught:
                make("mazebench/Local-13-v1", mapz="plan.png")
            assert {"mazes", "size", "split", "seed"} <= set(str(caught.value).split(": ")[1].split(", "))

    def test_an_environment_is_made_by_its_name_in_a_fresh_process(self):
        run_python("-c", "import gymnasium; gymnasium.make('mazebench:mazebench/Local-13-v1').reset(seed=0)")

    def test_each_task_track_and_size_has_an_id(self):
        assert {name for name in registration.registry if name.startswith("mazebench/")} == {*IDS, *TRACK_IDS}

    @pytest.mark.parametrize("name", [*IDS[::5], *TRACK_IDS])
    def test_an_id_leads_to_its_task_or_track_and_size(self, name):
        assert gymnasium.spec(name).max_episode_steps is None
        title, size = name.removeprefix("mazebench/").split("-")[:2]
        task = gymnasium.make(name).unwrapped.task
        expected = (title.removesuffix("Goal").lower(), int(size) if size.isdigit() else 31)
        assert (task.options.task, task.size) == expected

    def test_an_environment_is_made_with_options(self):
        env = gymnasium.make("mazebench/Local-13-v1", split="eval", distances=[7], context_size=9, seed=3)
        spec = env.unwrapped.task
        assert (spec.mazes[0].name, spec.distances, spec.context_size) == ("13-eval-00", (7,), 9)
        first, again = env.reset()[0], env.reset(seed=3)[0]
        np.testing.assert_array_equal(first["state"], again["state"])

    def test_a_vector_environment_is_made_without_warnings(self):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            envs = gymnasium.make_vec("mazebench/Local-13-v1", num_envs=3)
            observations, _ = envs.reset(seed=0)
            envs.step(envs.action_space.sample())
            envs.close()
        assert isinstance(envs, MazeVectorEnv)
        assert observations["context"].shape == (3, 4, 13, 13)


# Both checkers doubt what is meant: a state without bounds, a context that is no picture.
@pytest.mark.filterwarnings("ignore::UserWarning")
class TestCheckers:
    @pytest.mark.parametrize("name", ["mazebench/Local-13-v1", "mazebench/Hierarchical-13-v1"])
    def test_environments_pass_the_checks_of_gymnasium_and_of_stable_baselines(self, name):
        env_checker.check_env(gymnasium.make(name).unwrapped, skip_render_check=True)
        checker = pytest.importorskip("stable_baselines3.common.env_checker")
        checker.check_env(gymnasium.make(name).unwrapped)

    @pytest.mark.slow
    def test_torchrl_makes_an_environment_by_its_id(self):
        env = pytest.importorskip("torchrl.envs").GymEnv("mazebench/Rebuilt-v1", level=(1, 2), distances=[1, 2])
        rollout = env.rollout(150, break_when_any_done=False)
        assert rollout["lidar"].shape == (150, 32)
        assert rollout["next", "done"].any()


class TestSteps:
    def test_a_step_before_the_first_reset_is_refused(self):
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            corridor_env().step(FORWARD)
        with pytest.raises(gymnasium.error.ResetNeeded):
            gymnasium.make("mazebench/Local-13-v1").step(FORWARD)

    def test_a_step_after_the_end_is_refused(self):
        env = corridor_env(time_limit=1)
        env.reset(seed=0)
        env.step(LOOK_LEFT)
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset"):
            env.step(LOOK_LEFT)
        env.reset()
        env.step(LOOK_LEFT)

    def test_the_info_has_what_records_and_training_need(self):
        _, info = corridor_env().reset()
        assert info.keys() == {
            *("is_first", "success", "goal_reached", "steps", "waited", "path_length", "position", "yaw", "maze"),
            *("landmark", "time_limit", "steps_left", "way_left", "distance", "blocked", "kind", "track", "level"),
        }


class TestRendering:
    @pytest.mark.filterwarnings("ignore:.*You are trying to use 'human' rendering")
    @pytest.mark.parametrize("name", ["Local-13", "LocalGoal-13", "Rough"])
    def test_gymnasium_adds_its_wrappers_of_other_render_modes(self, name):
        for mode, wrapper in (("rgb_array_list", "RenderCollection"), ("human", "HumanRendering")):
            env = gymnasium.make(f"mazebench/{name}-v1", render_mode=mode)
            assert isinstance(env, getattr(gymnasium.wrappers, wrapper))

    def test_two_environments_render_side_by_side(self):
        run_with_egl("""
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
envs.append(gymnasium.make("mazebench/Local-13-v1", render_mode="rgb_array_list"))
envs[2].reset(seed=0), envs[2].step(0)
np.testing.assert_array_equal(envs[2].render()[0], first)
for env in envs:
    env.close()
""")

    def test_a_vector_environment_renders_what_single_ones_do(self):
        run_with_egl("""
from mazebench.envs.registration import make, make_vec
envs = make_vec("local", 2, size=13, render_mode="rgb_array")
envs.reset(seed=0)
pictures = envs.render()
assert len(pictures) == 2
for seed, picture in enumerate(pictures):
    env = make("local", size=13, render_mode="rgb_array")
    env.reset(seed=seed)
    assert np.abs(env.render().astype(int) - picture).mean() < 1, "not the picture of the single environment"
    env.close()
""")


def own_mazes() -> list[Maze]:
    rng = np.random.default_rng(0)
    return [dataclasses.replace(generate("dfs", 7, rng, name), cell_size=0.5) for name in ("one", "two")]


class TestSpec:
    """`env.spec` describes an environment also as JSON."""

    OPTIONS = (
        {"seed": np.int64(3), "distances": range(1, 4)},
        {"mazes": own_mazes(), "distances": np.array([1, 2])},
        {"mazes": own_mazes()[0], "sensors": ("lidar",)},
        {"kinds": ("house",), "fresh": True},
    )

    @pytest.mark.parametrize("options", OPTIONS)
    @pytest.mark.parametrize("name", ["mazebench/Local-13-v1", "mazebench/LocalGoal-13-v1"])
    def test_an_environment_is_made_again_from_json(self, name, options):
        env = gymnasium.make(name, **options)
        again = gymnasium.make(EnvSpec.from_json(env.spec.to_json()))
        assert again.spec.to_json() == env.spec.to_json()
        assert again.unwrapped.task == env.unwrapped.task
        assert again.unwrapped.task.mazes[0].name == env.unwrapped.task.mazes[0].name

    @pytest.mark.parametrize("options", OPTIONS)
    def test_a_vector_environment_is_made_again_from_json(self, options):
        envs = gymnasium.make_vec(
            "mazebench/Local-13-v1", num_envs=3, autoreset_mode=AutoresetMode.NEXT_STEP, **options
        )
        again = gymnasium.make_vec(EnvSpec.from_json(envs.spec.to_json()))
        assert again.task == envs.task
        assert (again.num_envs, again.metadata) == (3, envs.metadata)

    @pytest.mark.parametrize("name", ["Local-13", "LocalGoal-13"])
    def test_a_goal_on_the_last_step_is_no_truncation_in_what_a_spec_makes(self, name):
        made = gymnasium.make(f"mazebench/{name}-v1", time_limit=4, distances=[1])
        modes = ("sync", "async") if name == "LocalGoal-13" else (None, "sync", "async", "vector_entry_point")
        for spec in (made.spec, EnvSpec.from_json(made.spec.to_json())):
            vectors = [gymnasium.make_vec(spec, vectorization_mode=mode) for mode in modes]
            for env in (made, gymnasium.make(spec), *vectors):
                env.reset(seed=3)  # four steps forward
                for _ in range(4):
                    _, _, terminated, truncated, _ = env.step(np.full(env.action_space.shape, FORWARD))
                assert (bool(terminated), bool(truncated)) == (True, False)
                env.close()

    def test_a_limit_of_gymnasiums_wrapper_is_kept(self):
        spec = gymnasium.wrappers.TimeLimit(gymnasium.make("mazebench/Local-13-v1"), 7).spec
        assert gymnasium.make(EnvSpec.from_json(spec.to_json())).spec.max_episode_steps == 7
        with pytest.raises(InputError, match="expected time_limit in the place of max_episode_steps, found 7"):
            gymnasium.make_vec("mazebench/Local-13-v1", num_envs=2, max_episode_steps=7)

    def test_a_path_stays_a_path(self, tmp_path):
        write_text_maze(own_mazes()[0], tmp_path / "room.txt")
        env = gymnasium.make("mazebench/Local-13-v1", mazes=tmp_path / "room.txt", distances=[1])
        assert env.spec.kwargs["mazes"] == str(tmp_path / "room.txt")
        assert gymnasium.make(EnvSpec.from_json(env.spec.to_json())).unwrapped.task == env.unwrapped.task

    def test_a_description_that_lacks_something_is_refused(self):
        with pytest.raises(InputError, match="expected a maze with name, rows, cell_size and kind, found rows"):
            gymnasium.make("mazebench/Local-13-v1", mazes=[{"rows": ["#####"]}])
