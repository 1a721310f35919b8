"""Tasks as values, drawn starts and goals, shown maps, and refused options."""

from __future__ import annotations

import collections
import dataclasses
import itertools
import json
import re

import numpy as np
import pytest
from processes import run_python
from simple_mazes import corridor, field

from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, resized
from mazebench.maps.text import format_maze, parse_maze, write_text_maze
from mazebench.results.naming import setting_of
from mazebench.tasks.episode import sample_episode
from mazebench.tasks.route import plan_route
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.task import Task, resolve_for_evaluation
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import LEVELS, TRACKS

CORRIDOR = corridor()
# No free cell at the corners (1, 5) and (5, 1): (2, 5) and (4, 1) are the nearest.
CUT_CORNERS = parse_maze("#######\n#...###\n#.....#\n#.....#\n#.....#\n##....#\n#######")


def dfs_mazes(size: int = 9, count: int = 3) -> tuple[Maze, ...]:
    rng = np.random.default_rng(0)
    return tuple(generate("dfs", size, rng, f"dfs-{index}") for index in range(count))


def episodes(spec: Task, count: int, seed: int = 0):
    rng = np.random.default_rng(seed)
    return [sample_episode(spec, rng) for _ in range(count)]


class TestValue:
    @pytest.mark.parametrize(
        "options",
        [
            {"task": "hierarchical", "size": 15, "landmark_distance": 3},
            {"task": "rough", "level": (1, 3), "sensors": "egocentric"},
            {"kinds": "house", "num_mazes": 2, "size": 17, "split": "dev"},
            {"kinds": ("dfs", "house"), "fresh": True},
            {"mazes": dfs_mazes(), "cell_size": 0.5, "distances": 3, "hide": "goal,map"},
            {"start": (1, 1), "goal": "3.5m,1.5m", "position_noise": 0.2},
            {"lidar_noise": ".1,.2", "sensors": "lidar", "num_goals": 3, "actions": "velocity"},
            {"reward": "progress"},
            {"task": "building", "mazes": field(31), "shown": field(31)},
        ],
        ids=lambda options: next(iter(options)),
    )
    def test_a_task_goes_to_json_and_back(self, options):
        task = Task.of(**options)
        again = Task.from_json(json.loads(json.dumps(task.options.to_json())))
        assert again == task
        assert again.mazes == task.mazes
        assert [each.walls.tobytes() for each in again.arena.shown or ()] == [
            each.walls.tobytes() for each in task.arena.shown or ()
        ]

    def test_results_do_not_name_the_reward_which_is_that_of_all_evaluations(self):
        assert "reward" not in resolve_for_evaluation(TaskOptions()).options.to_json()

    def test_mazes_of_a_file_are_the_same_when_the_task_is_read_again(self, tmp_path):
        write_text_maze(CORRIDOR, tmp_path / "corridor.txt")
        task = Task.of(mazes=tmp_path / "corridor.txt", cell_size=0.6)
        assert Task.from_json(task.options.to_json()).mazes == task.mazes == (resized(CORRIDOR, 0.6),)

    def test_the_interface_tells_levels_of_adrift_and_rough_and_no_others(self):
        interfaces = {(track, level): Task.of(track, level=level).interface for track in TRACKS for level in LEVELS}
        told = {(track, level) for track in ("adrift", "rough") for level in LEVELS}
        for one, other in itertools.combinations(interfaces, 2):
            assert (interfaces[one] == interfaces[other]) == (not told & {one, other})

    def test_results_of_one_setting_differ_in_what_an_agent_chooses_only(self):
        plain = resolve_for_evaluation(TaskOptions(size=15))
        chosen = resolve_for_evaluation(TaskOptions(size=15, sensors="egocentric", distances=(3,))).replace(
            context_size=9
        )
        flipped = resolve_for_evaluation(TaskOptions(size=15, map_flip=0.1))
        assert setting_of(plain.options) == setting_of(chosen.options) != setting_of(flipped.options)

    def test_options_that_evaluations_do_not_vary_are_refused(self):
        with pytest.raises(InputError, match="expected num_goals 1 in an evaluation, found 2"):
            resolve_for_evaluation(TaskOptions(num_goals=2))
        with pytest.raises(InputError, match="expected reward 'sparse' in an evaluation, found 'progress'"):
            resolve_for_evaluation(TaskOptions(reward="progress"))


class TestArena:
    """What was read and checked of mazes is held once."""

    def test_another_option_keeps_what_was_read(self, tmp_path):
        write_text_maze(CORRIDOR, tmp_path / "corridor.txt")
        task = Task.of(mazes=tmp_path / "corridor.txt")
        (tmp_path / "corridor.txt").unlink()  # it can't be read again
        for changes in ({"distances": 2}, {"position_noise": 0.5}, {"actions": "diff"}, {"num_goals": 2}):
            assert task.replace(**changes).arena is task.arena

    def test_tasks_of_a_track_share_the_benchmarks_mazes(self):
        task = Task.of("rebuilt", level=2)
        assert task.replace(level=3, num_goals=2).arena is task.arena
        assert Task.of("rebuilt", level=(1, 3), sensors="egocentric").arena is task.arena

    def test_another_start_is_checked_in_the_same_mazes(self):
        task = Task.of(mazes=CORRIDOR)
        assert task.replace(start=(1, 1), distances=6).mazes is task.mazes
        assert task.replace(start=(1, 1), distances=6).arena.ends(0) == ((1, 1), None)
        with pytest.raises(InputError, match="start '2,1': corridor: expected a free cell"):
            task.replace(start=(2, 1))
        with pytest.raises(InputError, match="expected distances of at most 3 cells"):  # from the middle
            task.replace(start=(1, 4), distances=4)

    def test_other_mazes_are_read(self):
        assert Task.of(size=13).replace(size=15).size == 15
        assert Task.of("rebuilt", split="dev").replace(split="train").mazes != Task.of("rebuilt", split="dev").mazes


class TestDistances:
    def test_all_distances_are_drawn_equally_often(self):
        distances = (2, 5, 7)
        spec = Task.of(mazes=dfs_mazes(), distances=distances)
        drawn = episodes(spec, 300)
        found = collections.Counter(spec.mazes[e.maze].distance(e.start, e.goal) for e in drawn)
        assert set(found) == set(distances)
        # Each about as often as the others: 300 draws, 7 standard deviations.
        share = 1 / len(distances)
        assert max(abs(count / 300 - share) for count in found.values()) <= 7 * np.sqrt(share * (1 - share) / 300)

    def test_mazes_and_yaws_are_drawn_uniformly(self):
        drawn = episodes(Task.of(mazes=dfs_mazes()), 300)
        assert {e.maze for e in drawn} == {0, 1, 2}
        yaws = np.array([e.yaw for e in drawn])
        assert np.all((yaws >= -np.pi) & (yaws < np.pi))
        assert np.all(np.histogram(yaws, bins=6, range=(-np.pi, np.pi))[0] > 20)
        assert len({e.seed for e in drawn}) == 300

    def test_only_starts_with_a_goal_far_enough_are_drawn(self):
        # At distance 6 in a corridor of 7 cells only the ends will do.
        drawn = episodes(Task.of(mazes=CORRIDOR, distances=[6]), 40)
        assert {(e.start, e.goal) for e in drawn} == {((1, 1), (1, 7)), ((1, 7), (1, 1))}

    def test_a_distance_that_a_maze_does_not_have_is_refused(self):
        with pytest.raises(InputError, match=r"corridor: expected distances of at most 6 cells.*found 7.*--distances"):
            Task.of(mazes=CORRIDOR, distances=[1, 7])

    def test_distances_depend_on_the_split_and_the_track_by_default(self):
        assert Task.of(split="train").distances == tuple(range(1, 6))
        assert Task.of(split="eval").distances == tuple(range(1, 16))
        assert Task.of("building", mazes=field(25)).distances == tuple(range(15, 41))
        assert Task.of("building", mazes=field(15)).distances == tuple(range(15, 25))


class TestFixedPairs:
    def test_fixed_pairs_are_one_a_maze_whatever_the_seed(self):
        spec = Task.of(mazes=dfs_mazes(), pairs="fixed")
        first, second = ({(e.maze, e.start, e.goal) for e in episodes(spec, 60, seed)} for seed in (1, 2))
        assert first == second
        assert len(first) == 3


class TestOptions:
    @pytest.mark.parametrize(
        ("options", "message"),
        [
            (
                {"task": "locl"},
                r"unknown task 'locl'; available: adrift, building, doors, hierarchical, local, rebuilt",
            ),
            ({"split": "test", "mazes": None}, r"unknown split 'test'; available: dev, eval, train"),
            ({"size": 14, "mazes": None}, r"unknown size 14; available: 13, 15, 17, 19, 21"),
            ({"size": 13}, r"expected mazes of size 13, found size 9"),
            ({"mazes": ()}, r"expected at least one maze, found none"),
            ({"mazes": (CORRIDOR, CUT_CORNERS)}, r"expected mazes of one size, found 7, 9"),
            ({"distances": ()}, r"expected at least one distance, found none"),
            ({"distances": (0, 1)}, r"expected distances of at least 1, found 0"),
            ({"time_limit": -1}, r"expected time_limit of at least 1, found -1"),
            ({"context_size": 2}, r"expected context_size from 3 to 255, found 2"),
            (
                {"num_goals": 2, "task": "hierarchical"},
                r"num_goals 2: expected task 'local', found 'hierarchical'",
            ),
            ({"num_goals": 2, "reward": "progress"}, r"num_goals 2: expected reward 'sparse', found 'progress'"),
            ({"mapz": "plan.txt"}, r"unexpected keyword argument 'mapz'; available: .*map_warp, mazes, .*size, split"),
            ({"map_warp": 0.26}, r"expected map_warp from 0 to 0\.25, found 0\.26"),
        ],
    )
    def test_an_option_out_of_range_is_refused(self, options, message):
        with pytest.raises(InputError, match=message):
            Task.of(**({"mazes": CORRIDOR} | options))

    @pytest.mark.parametrize(
        ("task", "options", "message"),
        [
            (
                "local",
                {"level": 2},
                "level 2: expected a track beside it, found none; tracks: building, rebuilt, adrift, rough",
            ),
            ("building", {"level": 0}, "expected level from 1 to 3, found 0"),
            ("building", {"level": ()}, "expected at least one level, found none"),
            ("building", {"level": (3, 3)}, "expected each level once, found 3, 3"),
            ("building", {"size": 51}, "track 'building': expected size 31, found 51"),
            ("rough", {"context_size": 31}, "track 'rough': expected context_size 62, found 31"),
            ("building", {"time_limit": 50}, "track 'building': has its own time limit, found time_limit 50"),
            ("building", {"num_goals": 6}, "track 'building': expected num_goals of at most 5, found 6"),
            ("adrift", {"num_goals": 2}, "track 'adrift': expected num_goals of at most 1, found 2"),
            ("building", {"pairs": "fixed"}, "track 'building': expected pairs 'random', found 'fixed'"),
            ("building", {"map_warp": 0.1}, "track 'building': expected map_warp 0.0, found 0.1"),
            (
                "building",
                {"mazes": CORRIDOR},
                "corridor: expected distances of at most 6 m, as far as the maze reaches, found 40; choose others",
            ),
        ],
    )
    def test_an_option_that_contradicts_a_track_is_refused(self, task, options, message):
        with pytest.raises(InputError, match=re.escape(message)):
            Task.of(task, **options)

    def test_reading_the_options_does_not_load_mujoco(self):
        # The command line reads them before it chooses MuJoCo's rendering backend.
        program = "import sys, mazebench.tasks.task; sys.exit('mujoco' in sys.modules)"
        run_python("-c", program)

    def test_maps_may_be_a_maze_a_sequence_a_file_or_a_folder(self, tmp_path):
        path = tmp_path / "corridor.txt"
        path.write_text(format_maze(CORRIDOR), encoding="ascii")
        for maps in (CORRIDOR, [CORRIDOR], path, str(path), tmp_path):
            assert Task.of(mazes=maps).mazes == (CORRIDOR,)

    def test_own_mazes_that_share_a_name_are_told_apart(self):
        houses = [generate("house", 13, np.random.default_rng(seed)) for seed in range(2)]
        found = Task.of(mazes=[*houses, dataclasses.replace(houses[0], name="mine")]).mazes
        assert [maze.name for maze in found] == ["house-13-0", "house-13-1", "mine"]


class TestShownMap:
    def test_an_episodes_map_follows_from_its_seed(self):
        for options in ({"map_flip": 0.3}, {"map_warp": 0.2}):
            spec = Task.of(mazes=dfs_mazes(), **options)
            first, second = episodes(spec, 2)
            np.testing.assert_array_equal(self.context(spec, first), self.context(spec, first))
            other = dataclasses.replace(first, seed=second.seed)
            assert not np.array_equal(self.context(spec, first), self.context(spec, other))

    def test_a_warp_does_not_change_which_cells_are_flipped(self):
        # Each has a stream of its own: a warp changes nothing about which cells are flipped.
        flipped = Task.of(mazes=dfs_mazes(), map_flip=0.3)
        both = Task.of(mazes=dfs_mazes(), map_flip=0.3, map_warp=0.2)
        episode = episodes(flipped, 1)[0]
        np.testing.assert_array_equal(show_map(flipped, episode).walls, show_map(both, episode).walls)

    def test_a_warped_map_has_one_mark_each_for_start_and_goal(self):
        # One mark each, wherever it went, and the crop stands at the start's.
        spec = Task.of(mazes=dfs_mazes(), map_warp=0.25)
        for episode in episodes(spec, 30):
            planes = self.context(spec, episode)
            assert planes[2].sum() == planes[3].sum() == 1
            row, column = np.argwhere(planes[3])[0]
            assert planes[1][4, 4] == planes[0][row, column]

    def context(self, spec: Task, episode) -> np.ndarray:
        return leg_context(spec, show_map(spec, episode), episode.start, episode.goal)


class TestHierarchical:
    @pytest.mark.parametrize(
        ("mazes", "ends"),
        [(dfs_mazes(), ((1, 7), (7, 1))), (CUT_CORNERS, ((2, 5), (4, 1))), (CORRIDOR, ((1, 7), (1, 1)))],
    )
    def test_episodes_lead_from_corner_to_corner_or_the_free_cells_nearest_to_them(self, mazes, ends):
        episode = episodes(Task.of("hierarchical", mazes=mazes), 1)[0]
        assert (episode.start, episode.goal) == ends

    @pytest.mark.parametrize("every", [1, 5])
    def test_landmarks_lie_on_a_shortest_path_at_equal_distances(self, every):
        spec = Task.of("hierarchical", mazes=dfs_mazes(), landmark_distance=every)
        for episode in episodes(spec, 5):
            maze, cells = spec.mazes[episode.maze], plan_route(spec, episode, show_map(spec, episode)).cells
            legs = [maze.distance(one, other) for one, other in itertools.pairwise(cells)]
            assert legs[:-1] == [every] * (len(legs) - 1)
            assert 1 <= legs[-1] <= every
            assert sum(legs) == maze.distance(episode.start, episode.goal)
            assert cells[-1] == episode.goal

    def test_landmarks_are_planned_on_the_flipped_map(self):
        # The corridor's cells are shown as walls, the others as free: the oracle plans through those.
        spec = Task.of("hierarchical", mazes=CORRIDOR, landmark_distance=1, map_flip=1.0)
        episode = episodes(spec, 1)[0]
        cells = plan_route(spec, episode, show_map(spec, episode)).cells
        assert len(cells) == 9
        assert all(cell[0] == 2 for cell in cells[1:-1])

    def test_a_warp_does_not_move_landmarks(self):
        # Landmarks are cells of the world, which a warp of the planes does not move.
        plain = Task.of("hierarchical", mazes=dfs_mazes())
        warped = Task.of("hierarchical", mazes=dfs_mazes(), map_warp=0.2)
        episode = episodes(plain, 1)[0]
        routes = [plan_route(spec, episode, show_map(spec, episode)).cells for spec in (plain, warped)]
        assert routes[0] == routes[1]


class TestSeveralGoals:
    def test_the_next_goal_lies_at_a_wanted_distance(self):
        spec = Task.of(mazes=dfs_mazes(), distances=[2, 3], num_goals=50)
        episode = episodes(spec, 1)[0]
        maze, route = spec.mazes[episode.maze], plan_route(spec, episode, show_map(spec, episode))
        again = plan_route(spec, episode, show_map(spec, episode))
        found = set()
        for step in range(1, 50):
            for one in (route, again):
                one.advance(one.goal, step)
            assert route.cells == again.cells
            found.add(maze.distance(route.start, route.target))
        assert found == {2, 3}

    def test_the_farthest_cell_is_the_next_goal_if_none_is_far_enough(self):
        # From the middle of a corridor of 7 cells the farthest is 3 away.
        spec = Task.of(mazes=CORRIDOR, distances=[6], num_goals=2, time_limit=5)
        episode = episodes(spec, 1)[0]
        route = plan_route(spec, episode, show_map(spec, episode))
        route.advance((1, 4), 5)
        assert route.start == (1, 4)
        assert route.target in {(1, 1), (1, 7)}
