"""Bodies of one's own: what a file may say, that results hold it, and who can't drive it."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from simple_mazes import field

import mazebench
from mazebench.envs.gym import MazeEnv
from mazebench.errors import InputError
from mazebench.evaluation.suites import run_suite
from mazebench.maps.maze import Maze
from mazebench.maps.maze_files import read_maze
from mazebench.maps.readers.ros import write_ros_map
from mazebench.results.naming import described
from mazebench.results.reading import load_result
from mazebench.tasks.task import Task
from mazebench.tasks.time_limit import default_time_limit
from mazebench.world.bodies import BODIES
from mazebench.world.looks import Camera

VALUES = {
    "radius": 0.25, "height": 0.4, "mass": 12, "top_speed": 0.5, "turn_rate": 1.2, "acceleration": 0.8,
    "turn_acceleration": 2.5,
}  # fmt: skip


def written(folder, values, name: str = "cart.yaml") -> str:
    """Returns the path of a body's file."""
    (folder / name).write_text("\n".join(f"{key}: {value}" for key, value in values.items()), encoding="utf-8")
    return str(folder / name)


class TestFiles:
    def test_a_file_describes_a_body(self, tmp_path):
        task = Task.of(body=written(tmp_path, VALUES))
        body = task.body
        assert (body.name, body.radius, body.top_speed) == ("cart", 0.25, 0.5)
        assert body.turn_rate == pytest.approx(1.2)
        assert "body cart" in described(task.options)
        assert task == Task.of(body={"name": "cart", **VALUES}) == Task.of(body=body)
        assert Task.of(body=BODIES["service"]).options.body == "service"

    def test_results_hold_its_values_and_need_no_file(self, tmp_path):
        path, out = written(tmp_path, VALUES), tmp_path / "out"
        mazebench.evaluate("oracle", body=path, mazes=field(9), distances=[4], episodes_per_distance=2, out=out)
        (tmp_path / "cart.yaml").unlink()
        config = json.loads((out / "config.json").read_text(encoding="utf-8"))
        assert config["body"] == {
            "name": "cart", "camera_height": 0.8 * 0.4, "camera_offset": 0.0, "lidar_offset": 0.0, **VALUES
        }  # fmt: skip
        result = load_result(out)
        assert all(record.success for record in result.records)
        assert result.summary.task.driven_body.top_speed == 0.5

    @pytest.mark.parametrize(
        ("change", "said"),
        [
            ({"radius": -1}, "cart.yaml: radius.*found '-1'"),
            ({"radius": "wide"}, "cart.yaml: radius.*found 'wide'"),
            ({"mass": None}, "cart.yaml: mass"),
            ({"speed": 1}, "cart.yaml: speed.*not permitted"),
            ({"lidar_offset": 0.3}, r"cart.yaml: expected lidar_offset within the radius, 0.25 m, found 0.3"),
            ({"name": "service"}, "cart.yaml: expected a name of its own, found 'service'"),
        ],
    )
    def test_a_bad_value_is_named(self, tmp_path, change, said):
        with pytest.raises(InputError, match=said):
            Task.of(body=written(tmp_path, VALUES | change))

    def test_what_is_no_body_is_refused_in_a_line(self, tmp_path):
        with pytest.raises(InputError, match=r"mass: Field required; a body has name, radius"):
            Task.of(body=written(tmp_path, {key: value for key, value in VALUES.items() if key != "mass"}))
        with pytest.raises(InputError, match=r"none.yaml: can't read the body"):
            Task.of(body=str(tmp_path / "none.yaml"))
        with pytest.raises(InputError, match=r"unknown body 'zeppelin'.*turtlebot3.*YAML"):
            Task.of(body="zeppelin")
        (tmp_path / "text.yaml").write_text("hello", encoding="utf-8")
        with pytest.raises(InputError, match=r"text.yaml: expected a body's keys.*found 'hello'"):
            Task.of(body=str(tmp_path / "text.yaml"))


class TestSensors:
    def test_the_camera_and_the_lidar_are_where_the_body_has_them(self):
        task = Task.of(mazes=field(9), distances=[3], sensors="lidar,depth", body="turtlebot3")
        body, slider = task.body, task.replace(body="slider")
        assert task.interface.camera == Camera(height=body.camera_height, offset=body.camera_offset)
        assert slider.interface.camera == Camera()
        chosen = task.replace(camera_height=0.3)
        assert chosen.interface.camera == Camera(height=0.3, offset=body.camera_offset)
        assert "camera_height" not in task.options.to_json()

        # Where two of them stand at one pose, the lidar ahead of the centre is as much nearer to the wall ahead.
        ahead = {}
        for each in (task, slider):
            env = MazeEnv(each)
            observation, _ = env.reset(seed=3)
            (x, y), yaw = observation["state"][:2], observation["state"][5]
            middle = np.array([x, y]) + each.body.lidar_offset * np.array([math.cos(yaw), math.sin(yaw)])
            ends = [(8 - middle[0]) / math.cos(yaw), (1 - middle[0]) / math.cos(yaw)]
            ends += [(8 - middle[1]) / math.sin(yaw), (1 - middle[1]) / math.sin(yaw)]
            assert observation["lidar"][0] == pytest.approx(min(5.0, *(end for end in ends if end > 0)), abs=1e-4)
            ahead[each.body.name] = observation["lidar"][0]
        assert ahead["turtlebot3"] - ahead["slider"] == pytest.approx(0.032, abs=1e-4) or ahead["slider"] == 5.0


class TestMaps:
    def test_a_map_is_read_for_the_width_of_the_body(self, tmp_path):
        # Two rooms, joined by a door of 0.6 m.
        walls = np.zeros((60, 120), dtype=bool)
        walls[[0, -1]] = walls[:, [0, -1]] = True
        walls[:, 58:61] = True
        walls[25:31, 58:61] = False
        size = np.ones((120, 120), dtype=bool)
        size[:60] = walls
        write_ros_map(Maze(size, "rooms", cell_size=0.1), tmp_path / "map.yaml")
        path = str(tmp_path / "map.yaml")
        narrow, wide = Task.of(mazes=path, body="turtlebot3"), Task.of(mazes=path, body="service")
        assert narrow.cell_size == 0.4
        assert wide.cell_size == 0.8
        assert wide.mazes == (read_maze(path, radius=0.35),)
        # Its door is too narrow for the wide one, which has one of the rooms only.
        assert narrow.mazes[0].free_cells[:, 1].max() * 0.4 > 8
        assert len(wide.mazes[0].free_cells) * 0.8**2 < 0.6 * len(narrow.mazes[0].free_cells) * 0.4**2

    def test_cells_that_are_too_narrow_are_refused(self, tmp_path):
        write_ros_map(Maze(field(40).walls, "hall", cell_size=0.1), tmp_path / "map.yaml")
        with pytest.raises(InputError, match=r"cell_size of at least 0.8 m.*found 0.4"):
            Task.of(mazes=str(tmp_path / "map.yaml"), body="service", cell_size=0.4)


def test_learned_agents_are_refused_on_a_body_that_they_did_not_learn_on(tmp_path):
    for agent in ("dqn", "mah", "mmn", "map-policy", "neural-planner"):
        with pytest.raises(InputError, match=f"agent '{agent}': learned on the body 'slider', found 'turtlebot3'"):
            mazebench.evaluate(agent, body="turtlebot3", distances=[2], episodes_per_distance=1, out=tmp_path / agent)
    with pytest.raises(InputError, match=r"agent 'planner'.*found the body 'turtlebot3'"):
        mazebench.evaluate("planner", body="turtlebot3", distances=[2], episodes_per_distance=1, out=tmp_path / "p")


def test_time_limits_follow_the_speed():
    # A metre takes 29 steps of 0.035 m, a quarter turn 9; for the service robot 7 of 0.16 m, and 10.
    assert default_time_limit(20, 1.0, BODIES["turtlebot3"], track="building") == (29 + 9) * 20 + 29 * 25
    assert default_time_limit(20, 1.0, BODIES["service"], track="building") == (7 + 10) * 20 + 7 * 25


def test_a_suite_is_played_with_a_body(tmp_path):
    out = tmp_path / "suite"
    summaries = run_suite("llm-dev", ["random"], out, body="service")
    assert {summary.task.body for summary in summaries} == {"service"}
