"""How starts and goals are drawn, what the agent is shown, and which options are refused."""

from __future__ import annotations

import collections
import dataclasses
import itertools
import json
import subprocess
import sys

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.maps.generators import generate
from mazebench.maps.maze import Maze
from mazebench.maps.text import format_maze, parse_maze
from mazebench.tasks.registry import make_spec
from mazebench.tasks.spec import Perturbation, TaskSpec, sample_pair

# 7 free cells in a row.
CORRIDOR = parse_maze("#########\n#.......#\n" + "#########\n" * 7, "corridor")
# No free cell at the corners (1, 5) and (5, 1): (2, 5) and (4, 1) are the nearest.
CUT_CORNERS = parse_maze("#######\n#...###\n#.....#\n#.....#\n#.....#\n##....#\n#######")


def dfs_mazes(size: int = 9, count: int = 3) -> tuple[Maze, ...]:
    rng = np.random.default_rng(0)
    return tuple(generate("dfs", size, rng, f"dfs-{index}") for index in range(count))


def episodes(spec: TaskSpec, count: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    return [spec.sample_episode(rng) for _ in range(count)]


class TestDistances:
    @pytest.mark.parametrize("distances", [(3,), (1, 4), (2, 5, 7)])
    def test_distances_when_drawn(self, distances):
        spec = make_spec(maps=dfs_mazes(), distances=distances)
        drawn = episodes(spec, 300)
        found = collections.Counter(spec.mazes[e.maze].distance(e.start, e.goal) for e in drawn)
        assert set(found) == set(distances)
        # Each about as often as the others: 300 draws, 7 standard deviations.
        share = 1 / len(distances)
        assert max(abs(count / 300 - share) for count in found.values()) <= 7 * np.sqrt(share * (1 - share) / 300)

    def test_mazes_and_yaws_when_drawn(self):
        drawn = episodes(make_spec(maps=dfs_mazes()), 300)
        assert {e.maze for e in drawn} == {0, 1, 2}
        yaws = np.array([e.yaw for e in drawn])
        assert np.all((yaws >= -np.pi) & (yaws < np.pi))
        assert np.all(np.histogram(yaws, bins=6, range=(-np.pi, np.pi))[0] > 20)
        assert len({e.seed for e in drawn}) == 300

    def test_starts_when_drawn(self):
        # At distance 6 in a corridor of 7 cells only the ends will do.
        drawn = episodes(make_spec(maps=CORRIDOR, distances=[6]), 40)
        assert {(e.start, e.goal) for e in drawn} == {((1, 1), (1, 7)), ((1, 7), (1, 1))}

    def test_episodes_when_seed_is_the_same(self):
        spec = make_spec(maps=dfs_mazes())
        assert episodes(spec, 20, seed=3) == episodes(spec, 20, seed=3)
        assert episodes(spec, 20, seed=3) != episodes(spec, 20, seed=4)

    def test_distance_when_unreachable(self):
        with pytest.raises(InputError, match="corridor: no two cells are 7 cells apart; the farthest are 6"):
            make_spec(maps=CORRIDOR, distances=[1, 7])

    def test_distance_when_one_of_several_mazes_is_too_small(self):
        corridor_first = (CORRIDOR, dfs_mazes()[0])
        assert corridor_first[1].diameter > 6
        with pytest.raises(InputError, match="corridor: no two cells are"):
            make_spec(maps=corridor_first, distances=[corridor_first[1].diameter])

    def test_pair_when_no_two_cells_are_so_far_apart(self):
        with pytest.raises(InputError, match="found no two cells 7 cells apart; the farthest are 6"):
            sample_pair(CORRIDOR, 7, np.random.default_rng(0))

    def test_distances_when_not_given(self):
        assert make_spec(split="train").distances == tuple(range(1, 6))
        assert make_spec(split="eval").distances == tuple(range(1, 16))
        assert make_spec(maps=dfs_mazes(), split="eval").distances == tuple(range(1, 6))


class TestFixedPairs:
    def test_pairs_when_drawn_many_times(self):
        drawn = episodes(make_spec(maps=dfs_mazes(), pairs="fixed"), 60)
        pairs = {(e.maze, e.start, e.goal) for e in drawn}
        assert len(pairs) == 3
        assert len({e.yaw for e in drawn}) == 60

    def test_pairs_when_seeds_differ(self):
        spec = make_spec(maps=dfs_mazes(), pairs="fixed")
        first, second = ({(e.maze, e.start, e.goal) for e in episodes(spec, 60, seed)} for seed in (1, 2))
        assert first == second

    def test_distances_when_pairs_are_fixed(self):
        spec = make_spec(maps=dfs_mazes(), pairs="fixed", distances=[2, 3])
        assert {spec.mazes[e.maze].distance(e.start, e.goal) for e in episodes(spec, 60)} <= {2, 3}

    def test_pairs_when_drawn_in_another_process(self):
        program = (
            "import json, numpy as np, mazebench\n"
            "spec = mazebench.make_spec(size=13, pairs='fixed')\n"
            "rng = np.random.default_rng(99)\n"
            "drawn = [spec.sample_episode(rng) for _ in range(100)]\n"
            "print(json.dumps([[e.maze, e.start, e.goal] for e in drawn]))"
        )
        output = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
        elsewhere = {(maze, tuple(start), tuple(goal)) for maze, start, goal in json.loads(output)}
        here = {(e.maze, e.start, e.goal) for e in episodes(make_spec(size=13, pairs="fixed"), 400)}
        assert len(here) == 20
        assert elsewhere <= here


class TestOptions:
    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"task": "locl"}, r"unknown task 'locl'; available: hierarchical, local"),
            ({"pairs": "fix"}, r"unknown pairs 'fix'; available: fixed, random"),
            ({"split": "test", "maps": None}, r"unknown split 'test'; available: eval, train"),
            ({"size": 14, "maps": None}, r"unknown size '14'; available: 13, 15, 17, 19, 21"),
            ({"size": 13}, r"expected mazes of size 13, found size 9"),
            ({"maps": ()}, r"expected at least one maze, found none"),
            ({"maps": (CORRIDOR, CUT_CORNERS)}, r"expected mazes of one size, found sizes \[7, 9\]"),
            ({"maps": "no/such/file.txt"}, r"no/such/file\.txt"),
            ({"distances": ()}, r"expected distances of at least 1 cell, found \[\]"),
            ({"distances": (0, 1)}, r"expected distances of at least 1 cell, found \[0, 1\]"),
            ({"time_limit": 0}, r"expected time_limit from 1 to inf, found 0"),
            ({"landmark_distance": 0}, r"expected landmark_distance from 1 to inf, found 0"),
            ({"context_size": 2}, r"expected context_size from 3 to 255, found 2"),
            ({"context_size": 256}, r"expected context_size from 3 to 255, found 256"),
            ({"context_size": -5}, r"expected context_size from 3 to 255, found -5"),
            ({"num_goals": 0}, r"expected num_goals from 1 to inf, found 0"),
            ({"num_goals": 2, "task": "hierarchical"}, r"expected num_goals from 1 to 1, found 2"),
            ({"map_flip": -0.1}, r"expected map_flip from 0 to 1\.0, found -0\.1"),
            ({"map_flip": 1.1}, r"expected map_flip from 0 to 1\.0, found 1\.1"),
            ({"map_flip": float("nan")}, r"expected map_flip from 0 to 1\.0, found nan"),
            ({"map_warp": 0.26}, r"expected map_warp from 0 to 0\.25, found 0\.26"),
            ({"map_warp": -0.01}, r"expected map_warp from 0 to 0\.25, found -0\.01"),
            ({"position_noise": -1}, r"expected position_noise .*, found -1"),
            ({"position_noise": float("inf")}, r"expected position_noise .*, found inf"),
            ({"position_noise": float("nan")}, r"expected position_noise .*, found nan"),
        ],
    )
    def test_option_when_out_of_range(self, options, message):
        with pytest.raises(InputError, match=message):
            make_spec(**({"maps": CORRIDOR} | options))

    def test_context_size_when_not_given(self):
        assert make_spec(maps=CORRIDOR).context_size == 9
        assert make_spec(maps=generate("obstacles", 30, np.random.default_rng(0))).context_size == 21

    def test_maps_when_given_as_maze_sequence_or_file(self, tmp_path):
        path = tmp_path / "corridor.txt"
        path.write_text(format_maze(CORRIDOR), encoding="ascii")
        for maps in (CORRIDOR, [CORRIDOR], path, str(path), tmp_path):
            assert make_spec(maps=maps).mazes == (CORRIDOR,)

    def test_options_when_at_their_bounds(self):
        spec = make_spec(maps=CORRIDOR, map_flip=1, map_warp=0.25, position_noise=0, time_limit=1, context_size=3)
        assert spec.perturbation == Perturbation(1, 0.25, 0)


class TestShownMap:
    def test_map_when_unperturbed(self):
        spec = make_spec(maps=dfs_mazes())
        episode = episodes(spec, 1)[0]
        shown = spec.show(episode)
        np.testing.assert_array_equal(shown.walls, spec.mazes[episode.maze].walls)
        assert shown.homography is None

    @pytest.mark.parametrize("probability", [0.1, 0.5, 1.0])
    def test_start_and_goal_when_flipped(self, probability):
        spec = make_spec(maps=dfs_mazes(), map_flip=probability)
        for episode in episodes(spec, 30):
            walls, shown = spec.mazes[episode.maze].walls, spec.show(episode).walls
            assert not shown[episode.start]
            assert not shown[episode.goal]
            border = np.ones_like(walls)
            border[1:-1, 1:-1] = False
            assert shown[border].all()

    def test_inner_cells_when_all_are_flipped(self):
        spec = make_spec(maps=CORRIDOR, map_flip=1.0)
        episode = episodes(spec, 1)[0]
        expected = ~CORRIDOR.walls
        expected[[0, -1]] = expected[:, [0, -1]] = True
        expected[episode.start] = expected[episode.goal] = False
        np.testing.assert_array_equal(spec.show(episode).walls, expected)

    def test_share_of_cells_when_flipped(self):
        spec = make_spec(maps=dfs_mazes(size=21, count=1), map_flip=0.2)
        flipped = sum((spec.show(e).walls != spec.mazes[0].walls).sum() for e in episodes(spec, 50))
        assert flipped / (50 * (19 * 19 - 2)) == pytest.approx(0.2, abs=0.02)

    def test_map_when_shown_again(self):
        for options in ({"map_flip": 0.3}, {"map_warp": 0.2}):
            spec = make_spec(maps=dfs_mazes(), **options)
            first, second = episodes(spec, 2)
            np.testing.assert_array_equal(self.context(spec, first), self.context(spec, first))
            other = dataclasses.replace(first, seed=second.seed)
            assert not np.array_equal(self.context(spec, first), self.context(spec, other))

    def test_world_when_map_is_perturbed(self):
        spec = make_spec(maps=dfs_mazes(), map_flip=1.0, map_warp=0.2)
        before = [maze.walls.copy() for maze in spec.mazes]
        for episode in episodes(spec, 5):
            self.context(spec, episode)
        for maze, walls in zip(spec.mazes, before, strict=True):
            np.testing.assert_array_equal(maze.walls, walls)

    def test_flips_when_warped_as_well(self):
        # Each has a stream of its own: a warp changes nothing about which cells are flipped.
        flipped = make_spec(maps=dfs_mazes(), map_flip=0.3)
        both = make_spec(maps=dfs_mazes(), map_flip=0.3, map_warp=0.2)
        episode = episodes(flipped, 1)[0]
        np.testing.assert_array_equal(flipped.show(episode).walls, both.show(episode).walls)

    def test_marks_when_warped(self):
        # One mark each, wherever it went, and the crop stands at the start's.
        spec = make_spec(maps=dfs_mazes(), map_warp=0.25)
        for episode in episodes(spec, 30):
            planes = self.context(spec, episode)
            assert planes[2].sum() == planes[3].sum() == 1
            row, column = np.argwhere(planes[3])[0]
            assert planes[1][4, 4] == planes[0][row, column]

    def context(self, spec: TaskSpec, episode) -> np.ndarray:
        return spec.context(spec.show(episode), episode.start, episode.goal)


class TestHierarchical:
    def test_corners_when_free(self):
        episode = episodes(make_spec("hierarchical", maps=dfs_mazes()), 1)[0]
        assert (episode.start, episode.goal) == ((1, 7), (7, 1))

    def test_corners_when_walled_up(self):
        episode = episodes(make_spec("hierarchical", maps=CUT_CORNERS), 1)[0]
        assert (episode.start, episode.goal) == ((2, 5), (4, 1))

    def test_corners_when_maze_is_a_corridor(self):
        episode = episodes(make_spec("hierarchical", maps=CORRIDOR), 1)[0]
        assert (episode.start, episode.goal) == ((1, 7), (1, 1))

    @pytest.mark.parametrize("every", [1, 2, 5])
    def test_landmarks_when_planned(self, every):
        spec = make_spec("hierarchical", maps=dfs_mazes(), landmark_distance=every)
        for episode in episodes(spec, 5):
            maze, cells = spec.mazes[episode.maze], spec.route(episode, spec.show(episode)).cells
            legs = [maze.distance(one, other) for one, other in itertools.pairwise(cells)]
            assert legs[:-1] == [every] * (len(legs) - 1)
            assert 1 <= legs[-1] <= every
            assert sum(legs) == maze.distance(episode.start, episode.goal)
            assert cells[-1] == episode.goal

    def test_landmarks_when_map_is_flipped(self):
        # The corridor's cells are shown as walls, the others as free: the oracle plans through those.
        spec = make_spec("hierarchical", maps=CORRIDOR, landmark_distance=1, map_flip=1.0)
        episode = episodes(spec, 1)[0]
        cells = spec.route(episode, spec.show(episode)).cells
        assert len(cells) == 9
        assert all(cell[0] == 2 for cell in cells[1:-1])

    def test_landmarks_when_map_is_warped(self):
        # Landmarks are cells of the world, which a warp of the planes does not move.
        plain = make_spec("hierarchical", maps=dfs_mazes())
        warped = make_spec("hierarchical", maps=dfs_mazes(), map_warp=0.2)
        episode = episodes(plain, 1)[0]
        routes = [spec.route(episode, spec.show(episode)).cells for spec in (plain, warped)]
        assert routes[0] == routes[1]


class TestSeveralGoals:
    def test_next_goal_when_drawn(self):
        spec = make_spec(maps=dfs_mazes(), distances=[2, 3], num_goals=50)
        episode = episodes(spec, 1)[0]
        maze, route = spec.mazes[episode.maze], spec.route(episode, spec.show(episode))
        again = spec.route(episode, spec.show(episode))
        found = set()
        for step in range(1, 50):
            for one in (route, again):
                one.advance(one.goal, step)
            assert route.cells == again.cells
            found.add(maze.distance(route.start, route.target))
        assert found == {2, 3}

    def test_next_goal_when_no_cell_is_far_enough(self):
        # From the middle of a corridor of 7 cells the farthest is 3 away.
        spec = make_spec(maps=CORRIDOR, distances=[6], num_goals=2, time_limit=5)
        episode = episodes(spec, 1)[0]
        route = spec.route(episode, spec.show(episode))
        route.advance((1, 4), 5)
        assert route.start == (1, 4)
        assert route.target in {(1, 1), (1, 7)}
