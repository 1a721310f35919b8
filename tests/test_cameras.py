"""Pictures as observations, the same in all three environments, and rendering contexts that nobody closes."""

from __future__ import annotations

import os
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from dm_env import specs

from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.tasks.navigation import Environment
from mazebench.tasks.registry import make_spec

PROBE_FAILED = 77
PROBE = f"""
import sys
try:
    import mujoco
    mujoco.GLContext(64, 64).free()
except (RuntimeError, ImportError, AttributeError):
    sys.exit({PROBE_FAILED})
import gymnasium, mazebench, numpy as np
"""


def run(program: str) -> None:
    """Runs it in a process that renders by EGL; what it prints on standard error is a failure too."""
    result = subprocess.run(
        [sys.executable, "-c", PROBE + program], env=os.environ | {"MUJOCO_GL": "egl"}, capture_output=True, text=True
    )
    if result.returncode == PROBE_FAILED:
        pytest.skip("EGL is not usable here")
    assert (result.returncode, result.stderr) == (0, "")


class TestOptions:
    def test_specs_when_cameras_are_observed(self):
        spec = make_spec(cameras=["egocentric", "top"], camera_size=32)
        expected = specs.BoundedArray((32, 32, 3), np.uint8, 0, 255, name="egocentric")
        assert Environment(spec).observation_spec()["egocentric"] == expected
        space = MazeEnv(spec).observation_space
        assert set(space) == {"state", "context", "egocentric", "top"}
        assert space["top"] == gymnasium.spaces.Box(0, 255, (32, 32, 3), np.uint8)
        assert MazeVectorEnv(spec, 2).observation_space["top"].shape == (2, 32, 32, 3)
        assert make_spec(cameras="top").cameras == ("top",)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"cameras": "eyes"}, r"^unknown camera 'eyes'; available: chase, egocentric, top$"),
            ({"cameras": ["top", "top"]}, r"^expected each camera once, found top, top$"),
            ({"camera_size": 0}, r"^expected camera_size from 1 to 1280, found 0$"),
            ({"camera_size": 1281}, r"^expected camera_size from 1 to 1280, found 1281$"),
        ],
    )
    def test_option_when_out_of_range(self, options, message):
        with pytest.raises(InputError, match=message):
            make_spec(**options)


class TestPictures:
    def test_pictures_when_environments_are_compared(self):
        run("""
options = dict(size=13, cameras=["egocentric", "top"], time_limit=4)
actions = np.random.default_rng(0).integers(6, size=(9, 2))
envs = mazebench.make_vec("local", 2, **options)
env = gymnasium.make("mazebench/Local-13-v1", cameras=options["cameras"], time_limit=4).unwrapped
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
        for camera in options["cameras"]:
            np.testing.assert_array_equal(observation[camera], time_step.observation[camera])
        ended = terminated or truncated
        here.append(env.reset()[0] if ended else observation)
        if ended:
            dm.reset()
    for one, other in zip(here, seen, strict=True):
        for camera in options["cameras"]:
            assert one[camera].shape == (64, 64, 3) and one[camera].dtype == np.uint8
            np.testing.assert_array_equal(one[camera], other[camera][slot])
assert here[0]["top"].std() > 10 and not np.array_equal(here[0]["egocentric"], here[2]["egocentric"])
""")

    def test_final_picture_when_an_episode_ended(self):
        run("""
envs = mazebench.make_vec("local", 2, size=13, cameras="egocentric", time_limit=1)
alone = mazebench.load("local", size=13, cameras="egocentric", time_limit=2)
envs.reset(seed=[5, 6])
_, _, _, truncated, info = envs.step(np.array([4, 4]))
assert truncated.all()
for slot, seed in enumerate((5, 6)):
    alone.reset(seed=seed)
    expected = alone.step(4).observation["egocentric"]
    np.testing.assert_array_equal(info["final_obs"][slot]["egocentric"], expected)
""")

    def test_pictures_when_environment_is_goal_conditioned(self):
        run("""
env = gymnasium.make("mazebench/LocalGoal-13-v1", cameras=["top"], camera_size=48)
observation, _ = env.reset(seed=0)
assert observation["top"].shape == (48, 48, 3) and observation["observation"].shape == (12 + 3 * 13 * 13,)
""")

    def test_camera_when_closed_and_used_again(self):
        run("""
env = mazebench.load("local", cameras="top")
before = env.reset(seed=0).observation["top"]
env.close()
np.testing.assert_array_equal(env.reset(seed=0).observation["top"], before)
env.close()
""")


@pytest.mark.parametrize(
    "program",
    [
        "env = gymnasium.make('mazebench/Local-13-v1', render_mode='rgb_array'); env.reset(); env.render()",
        "env = gymnasium.make('mazebench/Local-13-v1', cameras='top'); env.reset()",
        "envs = mazebench.make_vec('local', 2, render_mode='rgb_array'); envs.reset(); envs.render()",
        "env = mazebench.load(cameras='egocentric'); env.reset()",
    ],
    ids=["render", "gymnasium", "vector", "dm_env"],
)
def test_process_when_nobody_closes_the_renderer(program):
    run(program)
