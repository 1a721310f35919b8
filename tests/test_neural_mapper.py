"""The neural mapper: what it writes of scans, what it plays, and what it reaches."""

import numpy as np
import pytest
from mazebench_agents.neural_mapper.network import REACH, SIDE, WallWriter, load, rows_of
from mazebench_agents.neural_mapper.neural_mapper import SHIPPED, NeuralMapper
from mazebench_agents.neural_mapper.scan_training import Walks
from mazebench_agents.robot.rays import ranges_to

from benchmarks.views import BlindMapper, ForgetfulMapper
from mazebench import evaluate
from mazebench.errors import InputError


def room(size: int = 11) -> np.ndarray:
    """Returns a square room `[11, 11]` bool of 5 x 5 cells."""
    walls = np.ones((size, size), dtype=bool)
    walls[3:8, 3:8] = False
    return walls


class TestWriting:
    def test_it_tells_walls_from_free_cells_and_leaves_what_no_ray_reached(self):
        walls, evidence, writer = room(), np.zeros((11, 11)), load(SHIPPED)
        for yaw in np.linspace(0, 2 * np.pi, 12):
            writer.write(evidence, 5.5, 5.5, yaw, ranges_to(walls, 5.5, 5.5, yaw, 32, REACH))
        assert (evidence[4:7, 4:7] < -3).all()
        assert (evidence[2, 4:7] > 1).all()
        assert (evidence[4:7, 8] > 1).all()
        assert (abs(evidence[0]) < 1).all()

    def test_a_patch_may_reach_over_the_edge_of_the_grid(self):
        writer, small = load(SHIPPED), np.zeros((3, 3))
        writer.write(small, 0.5, 0.5, 0.0, np.full(32, REACH))
        large = np.zeros((3 + 2 * SIDE,) * 2)
        writer.write(large, SIDE + 0.5, SIDE + 0.5, 0.0, np.full(32, REACH))
        np.testing.assert_allclose(small, large[SIDE:-SIDE, SIDE:-SIDE])

    def test_scans_are_turned_to_the_grid_by_whole_rays(self):
        ranges, ray = np.linspace(0.5, 3, 32)[None], 2 * np.pi / 32
        straight, turned = (rows_of(np.array([[1.5, 1.5, yaw]]), ranges)[0] for yaw in (0.0, 3 * ray))
        np.testing.assert_allclose(turned[3:32], straight[:29])
        np.testing.assert_allclose(turned[32:], straight[32:], atol=1e-6)

    def test_new_weights_have_the_shapes_of_the_shipped_ones(self):
        shapes = [
            {name: part.shape for name, part in each.state_dict().items()} for each in (WallWriter(), load(SHIPPED))
        ]
        assert shapes[0] == shapes[1]


def test_walks_see_the_true_walls_and_stay_in_free_cells():
    walks = Walks(seed=3)
    walks.begin(4)
    for _ in range(2):
        walked = walks.go_on()
        half = SIDE // 2
        for cells in walked.cells:
            assert not walked.walls[np.arange(4), cells[:, 0] + half, cells[:, 1] + half].any()
        assert (np.diff(walked.seen.astype(int), axis=0) >= 0).all()
        assert walked.seen[-1].any(axis=(1, 2)).all()


class TestDriving:
    def test_it_reaches_goals_where_doors_have_moved_and_less_without_scans_or_memory(self):
        options = {"level": 2, "split": "dev", "distances": (17, 23)}
        whole, blind, forgetful = (
            evaluate(agent, "rebuilt", **options).overall.success_rate
            for agent in (NeuralMapper, BlindMapper, ForgetfulMapper)
        )
        assert whole >= 0.9
        assert max(blind, forgetful) < whole

    @pytest.mark.parametrize(
        ("options", "found"),
        [({"task": "adrift"}, "noise 0.01"), ({"task": "rebuilt", "sensors": "egocentric"}, "found egocentric")],
    )
    def test_it_refuses_noisy_positions_and_other_sensors(self, options, found):
        with pytest.raises(InputError, match=r"agent 'neural-mapper': expected the sensor '?lidar") as error:
            evaluate("neural-mapper", split="dev", **options)
        assert found in str(error.value)

    def test_it_drives_alike_in_any_number_of_environments(self, tmp_path):
        steps = []
        for count in (1, 3):
            evaluate(
                "neural-mapper", "rebuilt", split="dev", distances=(17,), num_envs=count, out=tmp_path / str(count)
            )
            steps.append((tmp_path / str(count) / "episodes.jsonl").read_text())
        assert steps[0] == steps[1]
