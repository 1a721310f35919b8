"""The agent's camera, which needs no graphics driver, and MuJoCo's rendering contexts that nobody closes.

`python tests/test_cameras.py` rewrites the golden pictures.
"""

from __future__ import annotations

import hashlib
import pathlib

import cv2
import gymnasium
import numpy as np
import pytest
from dm_env import specs
from processes import run_with_egl

import mazebench
from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import EvalOptions
from mazebench.evaluation.plan import make_plan
from mazebench.maps.benchmark import ALL_SPLITS, load_kind_mazes
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, resized
from mazebench.tasks.sensors.cameras import as_colors
from mazebench.tasks.streams import Stream
from mazebench.tasks.task import Task, resolve_for_evaluation
from mazebench.tasks.task_options import TaskOptions
from mazebench.world.looks import EXPOSURES, LOOKS_VERSION, Camera, exposures_of, look_of, patterns
from mazebench.world.ray_camera import RayCamera
from mazebench.world.ray_casting import Lidar

COMPARISON = """
from scipy import ndimage
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.world.looks import LABELS, Camera
from mazebench.world.mjcf import maze_spec
from mazebench.world.ray_camera import RayCamera

SIZE, NUM_POSES = 64, 100
rng = np.random.default_rng(0)
walls = np.ones((15, 15), bool)
walls[1:-1, 1:-1] = False
walls[[3, 4, 5, 3, 4, 5, 8, 9, 10, 11, 12], [3, 4, 5, 8, 7, 6, 3, 4, 10, 11, 10]] = True  # touching at corners
mazes = [generate(kind, size, rng) for kind, size in (("dfs", 13), ("dfs", 21), ("house", 31), ("rooms", 31))]
mazes += [Maze(walls, "diagonal"), Maze(walls, "narrow", cell_size=0.6)]
compared = unequal = colors = close = 0
for maze in mazes:
    # Anywhere free; near walls and in corners; in the middle of cells, along axes and diagonals.
    cells = maze.point(maze.free_cells[rng.integers(len(maze.free_cells), size=NUM_POSES)])
    room = maze.cell_size / 2 - rng.uniform(0.15, 0.18, (NUM_POSES, 1))
    pose = np.c_[cells + room * rng.uniform(-1, 1, (NUM_POSES, 2)), rng.uniform(-4, 4, NUM_POSES)]
    pose[40:80, :2] = (cells + room * rng.integers(-1, 2, (NUM_POSES, 2)))[40:80]
    pose[80:] = np.c_[cells, rng.integers(8, size=NUM_POSES) * np.pi / 4][80:]
    ahead = maze.cell(pose[:, :2] + np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=1))
    marker = np.c_[maze.point(ahead), np.zeros(NUM_POSES)]
    nothing = np.zeros(NUM_POSES, int)
    seen = RayCamera((maze,), Camera(SIZE)).take(
        ("egocentric", "depth", "labels"), nothing, pose, marker, np.ones(NUM_POSES, np.float32), nothing - 1
    )

    model = maze_spec(maze).compile()
    model.vis.quality.offsamples = 0
    data, renderer = mujoco.MjData(model), mujoco.Renderer(model, SIZE, SIZE)
    label_of = {"floor": 1, **{f"wall_{index}": 2 for index in range(len(maze.boxes))}}
    labels = np.array([label_of.get(model.geom(index).name, -1) for index in range(model.ngeom)])
    for k in range(NUM_POSES):
        data.qpos[:], data.mocap_pos[0] = pose[k], marker[k]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_camlight(model, data)
        renderer.update_scene(data, "egocentric")
        picture = renderer.render().copy()
        renderer.enable_depth_rendering()
        depth = renderer.render().copy()
        renderer.disable_depth_rendering()
        renderer.enable_segmentation_rendering()
        number, kind = np.moveaxis(renderer.render(), 2, 0).copy()
        renderer.disable_segmentation_rendering()
        label = np.where(kind == mujoco.mjtObj.mjOBJ_GEOM, labels[number], 3)
        label[kind < 0] = 0
        assert label.min() >= 0
        at_edge = ndimage.grey_dilation(label, (3, 3)) != ndimage.grey_erosion(label, (3, 3))
        is_goal = (label == 3) | (seen["labels"][k] == 3)
        is_equal = label == seen["labels"][k]
        assert (is_equal | at_edge | is_goal).all()
        compared, unequal = compared + (~is_goal).sum(), unequal + (~is_equal & ~is_goal).sum()
        jumps = ndimage.maximum_filter(depth, 3) - ndimage.minimum_filter(depth, 3) > np.where(label == 2, 0.2, np.inf)
        sure = is_equal & ~at_edge & ~is_goal & ~jumps & (label > 0)
        np.testing.assert_allclose(np.minimum(depth, 10)[sure], seen["depth"][k][sure], rtol=0, atol=1e-3)
        flat = is_equal & ~is_goal & (label != 1)
        off = np.abs(picture.astype(int) - seen["egocentric"][k])[flat].max(axis=1)
        colors, close = colors + len(off), close + (off <= 4).sum()
    renderer.close()
assert unequal < 5e-4 * compared
assert close > 0.99 * colors
"""

GOLDEN = pathlib.Path(__file__).parent / "golden" / "pictures.png"
PICTURES = ("egocentric", "depth", "labels")
MAZE = generate("dfs", 7, np.random.default_rng(0))


def take(maze: Maze, camera: Camera, pose: np.ndarray, look: str = "plain", split: str = "train", threads: int = 1):
    """Returns pictures in one maze, with the goal a metre ahead of each body, and with noise if the look is varied."""
    count = len(pose)
    ahead = np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2]), np.zeros(count)], axis=1)
    marker = ahead + pose * (1, 1, 0)
    gain, noise_at = np.ones(count, np.float32), np.arange(count) if look == "varied" else np.full(count, -1)
    taker = RayCamera((maze,), camera, look, split)
    return taker.take(PICTURES, np.zeros(count, int), pose, marker, gain, noise_at, threads)


def free_poses(maze: Maze, rng: np.random.Generator, count: int) -> np.ndarray:
    cells = maze.point(maze.free_cells[rng.integers(len(maze.free_cells), size=count)])
    return np.c_[cells + rng.uniform(-0.3, 0.3, (count, 2)) * maze.cell_size, rng.uniform(-9, 9, count)]


class TestOptions:
    def test_all_environments_declare_the_sensors(self):
        task = Task.of(sensors=PICTURES, camera_size=32)
        assert Environment(task).observation_spec()["depth"] == specs.BoundedArray((32, 32), np.float32, 0, 10, "depth")
        space = MazeEnv(task).observation_space
        assert set(space) == {"state", "context", *PICTURES}
        assert space["egocentric"] == gymnasium.spaces.Box(0, 255, (32, 32, 3), np.uint8)
        assert MazeVectorEnv(task, 2).observation_space["labels"] == gymnasium.spaces.Box(0, 3, (2, 32, 32), np.uint8)
        assert task.interface.camera == Camera(32)

    @pytest.mark.parametrize("named", ["", "egocentric", "depth,lidar"])
    def test_sensors_that_are_named_replace_the_lidar_of_a_track(self, named):
        options = {"sensors": named, "camera_size": 8} if named else {}
        expected = {"state", "context", *(named or "lidar").split(",")}
        assert set(mazebench.make("rebuilt", **options).reset(seed=0)[0]) == expected
        assert set(mazebench.load("rebuilt", **options).reset(seed=0).observation) == expected
        assert set(mazebench.make_vec(("building", "adrift"), 2, **options).reset(seed=0)[0]) == expected

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"sensors": "eyes"}, r"^unknown sensors 'eyes'; available: depth, egocentric, labels, lidar$"),
            ({"sensors": ["depth", "depth"]}, r"^expected each sensor once, found depth, depth$"),
            ({"camera_size": 1281}, r"^expected camera_size from 1 to 1280, found 1281$"),
            ({"camera_fov": 361}, r"^expected camera_fov from 10 to 360, found 361$"),
            ({"look": "pretty"}, r"^unknown look 'pretty'; available: plain, varied$"),
            ({"look": "varied"}, r"^look varied: expected the sensor egocentric, found none$"),
            ({"look": "varied", "sensors": "depth"}, r"^look varied: expected the sensor egocentric, found depth$"),
            (
                {"task": "building", "camera_size": 32},
                r"^camera_size 32: expected the sensor egocentric or depth or labels, found lidar$",
            ),
        ],
    )
    def test_an_option_out_of_range_is_refused(self, options, message):
        with pytest.raises(InputError, match=message):
            Task.of(**options)

    def test_options_as_kept_records_have_them_can_be_read(self):
        written = TaskOptions().to_json()
        assert TaskOptions.from_json(written | {"camera_size": 64}) == TaskOptions()
        with pytest.raises(InputError, match="'textures'"):
            TaskOptions.from_json(written | {"textures": False})


class TestEnvironments:
    @pytest.mark.parametrize("options", [{}, {"look": "varied", "camera_fov": 200}, {"look": "varied", "fresh": True}])
    def test_pictures_are_the_same_in_all_environments(self, options):
        options = {"size": 13, "sensors": PICTURES, "camera_size": 24, "time_limit": 3, **options}
        actions = np.random.default_rng(0).integers(6, size=(7, 2))
        envs = mazebench.make_vec("local", 2, **options)
        seen = [envs.reset(seed=[3, 8])[0], *(envs.step(action)[0] for action in actions)]
        env, dm = mazebench.make("local", **options), mazebench.load("local", **options)
        for slot, seed in enumerate((3, 8)):
            here, there = [env.reset(seed=seed)[0]], [dm.reset(seed=seed).observation]
            for action in actions[:, slot]:
                observation, _, terminated, truncated, _ = env.step(action)
                step = dm.step(action)
                has_ended = terminated or truncated
                here.append(env.reset()[0] if has_ended else observation)
                there.append(dm.reset().observation if has_ended else step.observation)
            for one, two, many in zip(here, there, seen, strict=True):
                for name in PICTURES:
                    np.testing.assert_array_equal(one[name], many[name][slot])
                    np.testing.assert_array_equal(two[name], many[name][slot])
        assert len({picture["egocentric"].tobytes() for picture in here}) > 3

    def test_the_final_observation_has_the_ended_episodes_picture(self):
        envs = mazebench.make_vec("local", 2, size=13, sensors="egocentric", time_limit=1)
        alone = mazebench.load("local", size=13, sensors="egocentric", time_limit=2)
        envs.reset(seed=[5, 6])
        info = envs.step(np.array([4, 4]))[-1]
        for slot, seed in enumerate((5, 6)):
            alone.reset(seed=seed)
            expected = alone.step(4).observation["egocentric"]
            np.testing.assert_array_equal(info["final_obs"][slot]["egocentric"], expected)

    def test_the_look_changes_nothing_but_colours(self):
        options = {"task": "adrift", "level": 1, "sensors": ("lidar", *PICTURES)}
        plain, varied = (mazebench.make(**options, look=look) for look in ("plain", "varied"))
        for _ in range(2):
            one, other = plain.reset(seed=3)[0], varied.reset(seed=3)[0]
            for action in (0, 4, 0):
                for name in one:
                    assert np.array_equal(one[name], other[name]) == (name != "egocentric")
                one, other = plain.step(action)[0], varied.step(action)[0]


class TestGeometry:
    def test_depths_are_those_of_the_lidar(self):
        # Columns of 360 degrees lie between the lidar's rays. The first column looks back, the next ones to the left.
        rng = np.random.default_rng(1)
        for maze in (generate("dfs", 13, rng), generate("house", 31, rng), resized(generate("rooms", 15, rng), 0.6)):
            pose = free_poses(maze, rng, 20)
            depth = take(maze, Camera(32, 360, offset=0), pose)["depth"][:, 15]
            ranges = Lidar((maze,), 10.0).ranges(np.zeros(20, int), pose + np.array([0, 0, np.pi / 32]))
            np.testing.assert_allclose(depth, ranges[:, (15 - np.arange(32)) % 32], atol=1e-5)

    def test_labels_depths_and_colours_are_those_of_mujoco(self):
        run_with_egl(COMPARISON)

    def test_a_camera_may_look_up_and_stand_higher(self):
        maze = generate("dfs", 13, np.random.default_rng(0))
        pose = free_poses(maze, np.random.default_rng(1), 8)
        level = take(maze, Camera(64), pose)["depth"]
        up = take(maze, Camera(64, pitch=np.rad2deg(np.arctan(np.tan(np.deg2rad(37.5)) / 2))), pose)["depth"]
        np.testing.assert_array_equal(up[:, 16:], level[:, :-16])  # by a quarter of the picture
        low, high = (take(maze, Camera(64, height=height), pose)["labels"] for height in (0.3, 0.8))
        assert (high == 0).sum() > (low == 0).sum()
        assert (high == 1).sum() < (low == 1).sum()

    @pytest.mark.parametrize("look", ["plain", "varied"])
    def test_bodies_in_walls_outside_and_nowhere_have_pictures(self, look):
        maze = generate("dfs", 13, np.random.default_rng(0))
        places = [(0, 0), (-5, 3), (99, 99), (3, 3), (1, 1), (2.5, 2), (np.nan, 1)]
        for fov in (75, 360):
            seen = take(maze, Camera(16, fov), np.array([(*place, yaw) for place in places for yaw in (0, 0.7)]), look)
            assert ((seen["depth"] >= 0) & (seen["depth"] <= 10)).all()
            assert seen["labels"].max() <= 3

    def test_pictures_do_not_depend_on_threads(self):
        maze = generate("dfs", 13, np.random.default_rng(0))
        pose = free_poses(maze, np.random.default_rng(1), 40)
        np.testing.assert_equal(*(take(maze, Camera(16), pose, "varied", threads=threads) for threads in (1, 3)))


class TestLooks:
    def test_train_dev_and_eval_mazes_have_patterns_of_their_own(self):
        mazes = [generate("dfs", 13, np.random.default_rng(seed)) for seed in range(60)]
        drawn = [{*np.ravel([look_of(maze, "varied", split).patterns for maze in mazes])} for split in ALL_SPLITS]
        assert [len(each) for each in drawn] == [8 + 3, 4 + 2, 4 + 2]
        assert len(set().union(*drawn)) == 23
        assert len(np.unique(patterns(), axis=0)) == len(patterns())

    @pytest.mark.parametrize(
        ("split", "expected"),
        [
            ("train", "eef7130c2f0f6918bf4713816a2e5613dd3fb280b699eccb456ccc3452a2cd33"),
            ("dev", "7c37c0a65cf90d834b542ace6b9fd8bb2cb3bb682663324170e045eb8c5955f5"),
        ],
    )
    def test_train_and_dev_mazes_look_as_in_version_1(self, split, expected):
        masks = hashlib.sha256(patterns()[:51].tobytes()).hexdigest()
        assert masks == "a3344cc1a343b61a9168536c017027d68360a83662c82c421282ece1a0343699"
        of_mazes = hashlib.sha256()
        for maze in load_kind_mazes(split):
            for part in look_of(maze, "varied", split):
                of_mazes.update(part.tobytes())
        assert of_mazes.hexdigest() == expected
        assert EXPOSURES[split] == (0.3, 2.2)

    @pytest.mark.parametrize(
        ("options", "in_environment", "in_evaluation"),
        [
            ({}, "train", "eval"),
            ({"task": "rebuilt"}, "train", "dev"),
            ({"task": "rebuilt", "split": "eval"}, "eval", "eval"),
            ({"kinds": ("cave",), "distances": (2,)}, "train", "dev"),
            ({"mazes": MAZE, "distances": (2,)}, "train", "dev"),
            ({"mazes": MAZE, "distances": (2,), "split": "eval"}, "dev", "dev"),
            ({"mazes": MAZE, "distances": (2,), "split": "train"}, "train", "train"),
            ({"task": "building", "mazes": "real:cafe"}, "eval", "eval"),
        ],
    )
    def test_own_mazes_never_look_as_eval_mazes_do(self, options, in_environment, in_evaluation):
        options = {"sensors": "egocentric", "look": "varied", **options}
        assert Task.of(**options).options.look_split == in_environment
        assert resolve_for_evaluation(TaskOptions.of(options)).options.look_split == in_evaluation

    @pytest.mark.parametrize("split", ALL_SPLITS)
    def test_an_environment_has_the_patterns_and_exposures_of_its_split(self, split):
        options = {"sensors": "egocentric", "look": "varied", "camera_size": 16}
        env = mazebench.make_vec("building", 8, split=split, **options)
        observations, _ = env.reset(seed=3)
        rules, streams = env.rules, [episode.stream(Stream.PICTURE_NOISE) for episode in env.rules.episodes]
        light = [exposures_of(rng, 1, split) for rng in streams]
        gain, noise_at = (np.concatenate(each) for each in zip(*light, strict=True))
        camera = RayCamera(env.task.mazes, Camera(16), "varied", split)
        expected = camera.take(("egocentric",), rules.maze, rules.pose, rules.marker, gain, noise_at)
        np.testing.assert_equal(observations["egocentric"], expected["egocentric"])
        darkest, brightest = EXPOSURES[split]
        gain, _ = exposures_of(np.random.default_rng(0), 4096, split)
        assert (gain.min(), gain.max()) == pytest.approx((darkest, brightest), rel=0.01)
        env.close()

    def test_results_have_the_version_of_the_looks(self):
        for look, version in (("plain", None), ("varied", LOOKS_VERSION)):
            task = TaskOptions(task="building", sensors=("egocentric",), look=look)
            assert make_plan(EvalOptions(agent="random", task=task)).provenance.looks_version == version

    def test_equal_walls_look_equal(self):
        one, other = (generate("dfs", 13, np.random.default_rng(seed)) for seed in (0, 1))
        looks = [look_of(maze, "varied", "train") for maze in (one, Maze(one.walls, "another name"), other)]
        np.testing.assert_equal(looks[0], looks[1])
        assert not np.array_equal(looks[0].colors, looks[2].colors)

    def test_pictures_are_the_golden_ones(self):
        golden = cv2.imread(str(GOLDEN))[..., ::-1].astype(int)
        assert np.abs(golden_pictures() - golden).max() <= 1


def golden_pictures() -> np.ndarray:
    """Returns pictures of each look, their depths and labels in colours, side by side: `[H, W, 3]` uint8."""
    maze = generate("rooms", 15, np.random.default_rng(3))
    pose = free_poses(maze, np.random.default_rng(8), 3)
    rows = []
    for look, split, fov in (("plain", "train", 75), ("varied", "train", 75), ("varied", "dev", 200)):
        seen = take(maze, Camera(24, fov), pose, look, split)
        rows.append(np.concatenate([as_colors(name, each) for name in PICTURES for each in seen[name]], axis=1))
    return np.concatenate(rows)


class TestModels:
    def test_pictures_of_mazes_are_those_of_their_whole_models(self):
        run_with_egl("""
import mujoco
from mazebench.maps.kinds import generate
from mazebench.world.mjcf import maze_spec
from mazebench.world.rendering import Cameras
mazes = [generate(kind, 13, np.random.default_rng(1)) for kind in ("rooms", "dfs", "house")]
cameras = Cameras(mazes, ("top", "egocentric"), 200)
for index in (0, 1, 2, 1):
    model = maze_spec(mazes[index]).compile()
    data = mujoco.MjData(model)
    data.qpos[:2], data.mocap_pos[0] = mazes[index].point(mazes[index].free_cells[0]), 1
    mujoco.mj_forward(model, data)
    renderer = mujoco.Renderer(model, 200, 200)
    for camera, picture in cameras.take(index, data.qpos, data.mocap_pos[0]).items():
        renderer.update_scene(data, camera)
        np.testing.assert_array_equal(picture, renderer.render())
    renderer.close()
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


@pytest.mark.parametrize(
    "program",
    [
        "env = gymnasium.make('mazebench/Local-13-v1', render_mode='rgb_array')\nenv.reset(); env.render()",
        "envs = mazebench.make_vec('local', 2, render_mode='rgb_array'); envs.reset(); envs.render()\n"
        "env = mazebench.load(); env.reset(); env.physics.render()",
    ],
    ids=["gymnasium", "vector and dm_env"],
)
def test_a_process_ends_quietly_when_nobody_closes_the_renderer(program):
    run_with_egl(program)


if __name__ == "__main__":
    cv2.imwrite(str(GOLDEN), golden_pictures()[..., ::-1])
