"""A robot without lidar: what it feels of walls, and how it plays where the map or the position is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from mazebench_agents.robot.contacts import felt_walls
from mazebench_agents.robot.motion import Motion, moved
from mazebench_agents.robot.moving_body import FORWARD, LOOK_LEFT, MovingBody
from mazebench_agents.robot.occupancy import SURE
from simple_mazes import field

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.chunk import run_trials
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.kinds.obstacles import obstacles_walls
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials
from mazebench.world.bodies import SLIDER


def step(walls: np.ndarray, body: MovingBody, action: int) -> MovingBody:
    """The body after one action, by the model of its motion; walls are [row, column], a cell is a metre."""
    by_point = np.ascontiguousarray(walls[::-1].T)
    x, y, vx, vy = moved(Motion.of(SLIDER), by_point, 1.0, body.x, body.y, *body.velocity(), body.yaw, action)
    yaw = body.yaw + SLIDER.turn_step * (action == LOOK_LEFT)
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return MovingBody(SLIDER, x, y, yaw, cosine * vx + sine * vy, cosine * vy - sine * vx)


def test_a_wall_that_the_body_drives_against_is_felt():
    walls = field(7).walls
    body, felt = MovingBody(SLIDER, x=4.5, y=3.5, yaw=0.0, forward=0.0, left=0.0), []
    for _ in range(8):
        before, body = body, step(walls, body, FORWARD)
        felt += felt_walls(before, FORWARD, body, 1.0, 0.01, 7)
    assert {cell for cell, _ in felt} == {(3, 6)}


def test_nothing_is_felt_in_the_open():
    body = MovingBody(SLIDER, x=3.5, y=3.5, yaw=0.3, forward=0.0, left=0.0)
    after = step(field(7).walls, body, FORWARD)
    assert felt_walls(body, FORWARD, after, 1.0, 0.01, 7) == []


def test_a_corner_that_stops_the_body_is_no_wall_ahead():
    # Above the body is a free cell, and above on its left a wall, whose corner it hangs on.
    before = MovingBody(SLIDER, x=5.157, y=7.821, yaw=2.06, forward=-0.14, left=-0.26)
    after = MovingBody(SLIDER, x=5.178, y=7.989, yaw=2.06, forward=1.37, left=-1.00)
    assert (4, 5) not in {cell for cell, _ in felt_walls(before, FORWARD, after, 1.0, 0.01, 13)}


def test_what_is_felt_on_random_drives_are_walls():
    rng, num_right, num_felt = np.random.default_rng(0), 0, 0
    for _ in range(20):
        walls = obstacles_walls(9, rng)
        row, column = rng.choice(np.argwhere(~walls))
        body = MovingBody(SLIDER, x=column + 0.5, y=9 - row - 0.5, yaw=rng.uniform(-3, 3), forward=0.0, left=0.0)
        for _ in range(100):
            action = int(rng.integers(6))
            before, body = body, step(walls, body, action)
            felt = [cell for cell, log_odds in felt_walls(before, action, body, 1.0, 0.01, 9) if log_odds > SURE]
            num_felt, num_right = num_felt + len(felt), num_right + sum(bool(walls[cell]) for cell in felt)
    assert num_felt > 100
    assert num_right == num_felt


@pytest.mark.parametrize(
    ("options", "least"),
    [({}, 1.0), ({"map_flip": 0.1}, 0.9), ({"map_warp": 0.1}, 0.75), ({"position_noise": 1.0}, 0.9)],
)
def test_a_robot_without_lidar_reaches_goals(options, least):
    spec = Task.of(mazes=load_mazes(13, "train")[:8], distances=(4, 8, 12), **options)
    agent = load_agent_class("navigator").build(Interface("local", 13, 13))
    played = run_trials(agent, spec, dict(enumerate(draw_trials(spec, 2))), 64)
    assert np.mean([result.success for results in played for result in results]) >= least
