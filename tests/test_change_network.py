"""The network that tells which cells of a map have changed: its data, training, shipped weights and agent."""

from __future__ import annotations

import numpy as np
import pytest
from mazebench_agents.believer.learned import LearnedBeliever
from mazebench_agents.navigator import Navigator
from mazebench_agents.robot import change_training
from mazebench_agents.robot.change_network import load
from mazebench_agents.robot.change_training import Walks

import mazebench
from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.results.reading import load_result
from mazebench.tasks.task import Task

DEV = {"kinds": ("house",), "num_mazes": 1, "split": "dev", "distances": (15,), "episodes_per_distance": 2}


@pytest.fixture(scope="module")
def network():
    return load(LearnedBeliever.default_checkpoint())


@pytest.fixture(scope="module")
def walks():
    """Walks in mazes of train kinds that the shipped network was not trained on."""
    stream = Walks(seed=5_000)
    return [stream.draw() for _ in range(80)]


def changes(network, walk):
    return network.changes(walk.shown, walk.seen & walk.true, walk.seen & ~walk.true)


class TestWalks:
    def test_a_quarter_of_the_maps_is_right_and_others_have_more_and_more_moved_doors(self, walks):
        wrong = [np.mean([(walk.shown != walk.true).sum() for walk in walks[level::4]]) for level in range(4)]
        assert wrong[0] == 0
        assert wrong == sorted(wrong)

    def test_walls_hide_what_is_behind_them(self):
        walls = np.ones((7, 7), dtype=bool)
        walls[1:4, 1:6] = False
        walls[:, 3] = True
        seen, to_goal = np.zeros(walls.shape, dtype=bool), np.zeros(walls.shape, dtype=np.int32)
        lines = change_training.sight_lines(3.5)
        assert change_training._walk(walls, to_goal, 2 * 7 + 1, 1, *lines, seen) == 1
        assert seen[:5, :4].all()
        assert not seen[:, 4:].any()


class TestShippedNetwork:
    def test_it_tells_more_than_the_shares_of_doors_and_other_cells(self, network, walks):
        found, base = [], []
        for walk in walks:
            unseen, wrong = ~walk.seen[1:-1, 1:-1], (walk.shown != walk.true)[1:-1, 1:-1]
            told = changes(network, walk)[1:-1, 1:-1].clip(1e-6, 1 - 1e-6)
            found.append(-np.log(np.where(wrong, told, 1 - told))[unseen].mean())
            base.append(-np.log(np.where(wrong, 0.02, 0.98))[unseen].mean())
        assert np.mean(found) < 0.8 * np.mean(base)

    def test_it_expects_as_many_changes_as_there_are(self, network, walks):
        expected, true = 0.0, 0
        for walk in walks:
            unseen = ~walk.seen[1:-1, 1:-1]
            expected += changes(network, walk)[1:-1, 1:-1][unseen].sum()
            true += (walk.shown != walk.true)[1:-1, 1:-1][unseen].sum()
        assert 0.75 < expected / true < 1.33

    @pytest.mark.parametrize("size", [13, 30, 45])
    def test_maps_of_any_size_are_read(self, network, size):
        shown = generate("house", size, np.random.default_rng(0)).walls
        told = network.changes(shown, np.zeros_like(shown), np.zeros_like(shown))
        assert told.shape == shown.shape
        assert ((told > 0) & (told < 1)).all()

    def test_a_damaged_file_is_refused(self, tmp_path):
        (tmp_path / "changes.safetensors").write_bytes(LearnedBeliever.default_checkpoint().read_bytes()[:1000])
        with pytest.raises(InputError, match="expected a checkpoint of mazebench-agent-1, found"):
            LearnedBeliever.build(Task.of("rebuilt").interface, checkpoint=tmp_path / "changes.safetensors")


class TestAgent:
    def steps(self, agent, task, out, **options):
        mazebench.evaluate(agent, task, out=out, **DEV, **options)
        return [record.steps for record in load_result(out).records]

    def test_it_drives_as_the_navigator_where_the_map_is_drawn(self, tmp_path):
        learned, other = (self.steps(each, "rough", tmp_path / each.__name__) for each in (LearnedBeliever, Navigator))
        assert learned == other

    def test_it_drives_alike_in_any_number_of_environments(self, tmp_path):
        one, many = (
            self.steps(LearnedBeliever, "rebuilt", tmp_path / str(count), level=3, num_envs=count) for count in (1, 2)
        )
        assert one == many
