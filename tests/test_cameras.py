"""Pictures as observations, the same in all three environments, and rendering contexts that nobody closes."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from dm_env import specs
from processes import run_with_egl

from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.tasks.task import Task


class TestOptions:
    def test_all_environments_declare_the_sensors(self):
        spec = Task.of(sensors=["egocentric", "top"], camera_size=32)
        expected = specs.BoundedArray((32, 32, 3), np.uint8, 0, 255, name="egocentric")
        assert Environment(spec).observation_spec()["egocentric"] == expected
        space = MazeEnv(spec).observation_space
        assert set(space) == {"state", "context", "egocentric", "top"}
        assert space["top"] == gymnasium.spaces.Box(0, 255, (32, 32, 3), np.uint8)
        assert MazeVectorEnv(spec, 2).observation_space["top"].shape == (2, 32, 32, 3)
        assert Task.of(sensors="top").sensors == ("top",)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"sensors": "eyes"}, r"^unknown sensors 'eyes'; available: chase, egocentric, lidar, top$"),
            ({"sensors": ["top", "top"]}, r"^expected each sensor once, found top, top$"),
            ({"camera_size": 0}, r"^expected camera_size from 1 to 1280, found 0$"),
            ({"camera_size": 1281}, r"^expected camera_size from 1 to 1280, found 1281$"),
        ],
    )
    def test_an_option_out_of_range_is_refused(self, options, message):
        with pytest.raises(InputError, match=message):
            Task.of(**options)


class TestPictures:
    def test_pictures_are_the_same_in_all_environments(self):
        run_with_egl("""
options = dict(size=13, sensors=["egocentric", "top"], time_limit=4)
actions = np.random.default_rng(0).integers(6, size=(9, 2))
envs = mazebench.make_vec("local", 2, **options)
env = gymnasium.make("mazebench/Local-13-v1", sensors=options["sensors"], time_limit=4).unwrapped
dm = mazebench.load("local", **options)
seen = [envs.reset(seed=[3, 8])[0]]
for action in actions:
    seen.append(envs.step(action)[0])
for slot, seed in enumerate((3, 8)):
    here = [env.reset(seed=seed)[0]]
    there = [dm.reset(seed=seed).observation]
    for action in actions[:, slot]:
        observation, _, terminated, truncated, _ = env.step(action)
        time_step = dm.step(action)
        for camera in options["sensors"]:
            np.testing.assert_array_equal(observation[camera], time_step.observation[camera])
        ended = terminated or truncated
        here.append(env.reset()[0] if ended else observation)
        if ended:
            dm.reset()
    for one, other in zip(here, seen, strict=True):
        for camera in options["sensors"]:
            assert one[camera].shape == (64, 64, 3) and one[camera].dtype == np.uint8
            np.testing.assert_array_equal(one[camera], other[camera][slot])
assert here[0]["top"].std() > 10 and not np.array_equal(here[0]["egocentric"], here[2]["egocentric"])
""")

    def test_the_final_observation_has_the_ended_episodes_picture(self):
        run_with_egl("""
envs = mazebench.make_vec("local", 2, size=13, sensors="egocentric", time_limit=1)
alone = mazebench.load("local", size=13, sensors="egocentric", time_limit=2)
envs.reset(seed=[5, 6])
_, _, _, truncated, info = envs.step(np.array([4, 4]))
assert truncated.all()
for slot, seed in enumerate((5, 6)):
    alone.reset(seed=seed)
    expected = alone.step(4).observation["egocentric"]
    np.testing.assert_array_equal(info["final_obs"][slot]["egocentric"], expected)
""")

    def test_mazes_of_too_many_boxes_for_a_model_look_the_same(self):
        run_with_egl("""
from mazebench.maps.kinds import generate
from mazebench.world import mjcf
from mazebench.world.models import MazeModels
from mazebench.world.rendering import Cameras
mazes = [generate("dfs", 13, np.random.default_rng(seed)) for seed in range(3)]
places = [(index, np.array([*maze.point(maze.free_cells[0]), 0.0])) for index, maze in enumerate(mazes)]
def pictures():
    cameras = Cameras(MazeModels(mazes), ("top", "egocentric"))
    return [cameras.take(index, qpos, np.zeros(3)) for index, qpos in places + places[::-1]]
whole = pictures()
mjcf.MAX_BOXES = sorted(len(maze.boxes) for maze in mazes)[0]  # two of them have more
for expected, found in zip(whole, pictures(), strict=True):
    for camera, picture in expected.items():
        np.testing.assert_array_equal(picture, found[camera])
""")

    def test_gymnasium_records_a_film_of_an_episode(self, tmp_path):
        pytest.importorskip("moviepy")
        run_with_egl(f"""
env = gymnasium.make("mazebench/Local-13-v1", render_mode="rgb_array", time_limit=4)
env = gymnasium.wrappers.RecordVideo(env, {str(tmp_path / "films")!r})
env.reset(seed=0)
for _ in range(4):
    env.step(0)
env.close()
""")
        assert [path.name for path in (tmp_path / "films").iterdir()] == ["rl-video-episode-0.mp4"]

    def test_environments_that_end_leave_the_pictures_of_others_as_they_are(self):
        run_with_egl("""
import gc
def opened():
    env = mazebench.load("local", size=13, sensors="egocentric")
    return env, env.reset(seed=9).observation["egocentric"]
env, before = opened()
other, _ = opened()
other.close()
np.testing.assert_array_equal(env.reset(seed=9).observation["egocentric"], before)
third, picture = opened()
np.testing.assert_array_equal(picture, before)
del third
gc.collect()
np.testing.assert_array_equal(env.reset(seed=9).observation["egocentric"], before)
""")


@pytest.mark.parametrize(
    "program",
    [
        "env = gymnasium.make('mazebench/Local-13-v1', render_mode='rgb_array', sensors='top')\n"
        "env.reset(); env.render()",
        "envs = mazebench.make_vec('local', 2, render_mode='rgb_array'); envs.reset(); envs.render()\n"
        "env = mazebench.load(sensors='egocentric'); env.reset()",
    ],
    ids=["gymnasium", "vector and dm_env"],
)
def test_a_process_ends_quietly_when_nobody_closes_the_renderer(program):
    run_with_egl(program)
