"""Ranges from pictures: what the network that ships is sure of is right, and what it is not sure of tells nothing."""

import numpy as np
import pytest
from mazebench_agents.navigator import Navigator
from mazebench_agents.robot.beams import add_scan, beams_of, log_likelihood
from mazebench_agents.robot.camera_ranges import MAX_RANGE, NUM_RAYS, SHIPPED, SURE, CameraRanges, rays_in_view
from mazebench_agents.robot.facing import TurningDrive
from mazebench_agents.robot.map_matching import MapBelief
from mazebench_agents.robot.moving_body import MovingBody
from mazebench_agents.robot.range_training import Pictures, train
from mazebench_agents.robot.senses import Memory

from mazebench.errors import UnplayableError
from mazebench.tasks.task import Task
from mazebench.testing import check_agent
from mazebench.world.bodies import SLIDER
from mazebench.world.looks import LOOKS, Camera
from mazebench.world.ray_casting import LidarModel

BEAMS = beams_of(LidarModel(max_range=3.5), 1.0)


def test_rays_that_tell_nothing_change_nothing():
    walls = np.pad(np.zeros((5, 5)), 1, constant_values=0.9)
    ranges = np.full(NUM_RAYS, np.nan)
    assert log_likelihood(walls, 3.2, 3.4, 0.3, ranges, BEAMS, 0.0) == 0
    evidence = np.zeros((7, 7))
    add_scan(evidence, 3.2, 3.4, 0.3, ranges, BEAMS, 0.0)
    assert np.argwhere(evidence).tolist() == [[3, 3]], "the body's own cell is free"

    ranges[0] = 1.8
    add_scan(evidence, 3.2, 3.4, 0.0, ranges, BEAMS, 0.0)
    assert evidence[3, 4] < 0 < evidence[3, 5]


@pytest.mark.parametrize(("fov", "count"), [(75, 19), (170, 45), (360, 95)])
def test_rays_in_view(fov, count):
    rays = rays_in_view(fov)
    assert len(set(rays)) == count
    assert 0 in rays


@pytest.mark.parametrize("look", LOOKS)
@pytest.mark.parametrize("fov", SHIPPED)
def test_ranges_that_the_network_is_sure_of_are_right(fov, look):
    """In mazes of dev, with patterns that it was not trained on."""
    pictures, true = Pictures(Task.of("building", split="dev").mazes, fov, 3, "dev").draw(look, 256)
    ranges = CameraRanges(Camera(fov=fov), "navigator").read(pictures)[:, rays_in_view(fov)]
    is_sure = ~np.isnan(ranges)
    off = np.abs(ranges - true.clip(max=MAX_RANGE))[is_sure]
    assert is_sure.mean() > 0.3
    assert np.median(off) < SURE
    assert (off < 0.3).mean() > 0.98


def test_a_picture_is_read_alike_in_any_batch():
    camera = CameraRanges(Camera(), "navigator")
    pictures = np.random.default_rng(0).integers(256, size=(40, 64, 64, 3), dtype=np.uint8)
    chosen = np.arange(40) == 37
    np.testing.assert_array_equal(camera.read(pictures, chosen)[37], camera.read(pictures)[37])


@pytest.mark.parametrize("camera", [Camera(fov=90), Camera(size=32), Camera(pitch=10)], ids=str)
def test_another_camera_is_refused(camera):
    with pytest.raises(UnplayableError, match="expected a lidar, or a camera of 64 pixels and 75, 170, 360"):
        CameraRanges(camera, "navigator")


def test_navigator_by_camera_keeps_its_contract():
    check_agent(Navigator, task="adrift", level=2, sensors="egocentric", look="varied")


def test_a_body_that_turns_drives_as_if_it_did_not():
    """It stands in a corridor with its back to the goal, and turns about as it drives there."""
    walls = np.ones((9, 9))
    walls[4, 1:8] = 0
    memory = Memory(
        MapBelief(walls, np.eye(9)[[4]].T @ np.eye(9)[[6]], 1, None, 9),
        MovingBody(SLIDER, 2.5, 4.5, 3.0, 0.0, 0.0),
        0.01,
        1.0,
    )
    drive, path = TurningDrive(3.0), [(4, column) for column in range(2, 7)]
    forward, left, turn = drive.follow(path, walls, memory)
    assert abs(turn) == 1
    heading = 3.0 + turn * SLIDER.turn_step / 2
    assert forward * np.cos(heading) - left * np.sin(heading) > 0.98, "east"
    assert memory.commanded[2] == pytest.approx(3.0 + turn * SLIDER.turn_step)
    assert memory.commanded[0] > 2.5


def test_training_lowers_the_loss():
    (_, first, _), (_, last, _) = (list(train(75, updates, seed=0))[-1] for updates in (2, 60))
    assert last < first - 0.3
