"""Mazes of one's own: cells of any size, a start and a goal, and the distances and the time limit that fit."""

from __future__ import annotations

import dataclasses
import json
import warnings

import numpy as np
import pytest
from simple_mazes import corridor, field

import mazebench
from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.constants import STEPS_PER_ACTION
from mazebench.errors import InputError, Remark
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import make_plan
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.maps.text import format_maze
from mazebench.report.episodes import read_results
from mazebench.results.naming import described
from mazebench.results.reading import load_result
from mazebench.results.trajectories import TRAJECTORIES, load_trajectories
from mazebench.tasks.episode import sample_episode
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials
from mazebench.world.bodies import SLIDER
from mazebench.world.models import models_of
from mazebench.world.simulation import MujocoSimulation

ROOM = "#######\n#.....#\n#.....#\n#.....#\n#.....#\n#.....#\n#######\n"


def dfs(size: int = 9, cell_size: float = 1.0, seed: int = 0) -> Maze:
    maze = generate("dfs", size, np.random.default_rng(seed), f"dfs-{seed}")
    return dataclasses.replace(maze, cell_size=cell_size)


def doubled(maze: Maze) -> Maze:
    """The same world in twice as many cells a side, of half the size."""
    return Maze(maze.walls.repeat(2, axis=0).repeat(2, axis=1), maze.name, maze.cell_size / 2)


@pytest.fixture(scope="module")
def scaled(tmp_path_factory):
    """Results of an evaluation in cells of half a metre."""
    folder = tmp_path_factory.mktemp("scaled")
    (folder / "maze.txt").write_text(format_maze(dfs(13)))
    options = {"mazes": folder / "maze.txt", "cell_size": 0.5, "sensors": ("lidar",), "episodes_per_distance": 1}
    mazebench.evaluate("oracle", out=folder / "oracle", record=True, **options)
    return folder / "oracle"


class TestScale:
    """A world does not depend on how many cells it is cut into."""

    def test_a_body_drives_the_same_way(self):
        maze = dfs()
        paths = []
        for each in (maze, doubled(maze)):
            simulation = MujocoSimulation(models_of((each,), SLIDER)[0])
            with simulation.reset_context():
                simulation.place_agent(maze.point(maze.free_cells[0]), 0.3)
            path = []
            for action in (0, 0, 0, 4, 4, 0, 0, 2, 2, 1, 0, 0, 0, 5, 0, 0):
                simulation.set_controls(SLIDER.action_controls()[action])
                simulation.step(STEPS_PER_ACTION)
                path.append(simulation.position())
            paths.append(path)
        np.testing.assert_array_equal(*paths)


class TestTask:
    def test_mazes_of_one_task_have_one_scale(self):
        with pytest.raises(InputError, match=r"expected mazes of cells of one size in metres, found 0.5, 1.0"):
            Task.of(mazes=(dfs(), dfs(cell_size=0.5, seed=1)))

    def test_cells_through_which_no_body_passes_are_refused(self):
        with pytest.raises(InputError, match=r"dfs-0: expected cells of at least 0.4 m.*found 0.35 m"):
            Task.of(mazes=dfs(cell_size=0.35))

    def test_a_maze_of_a_folder_that_can_not_be_played_is_left_out_with_a_line(self, tmp_path, remarks):
        for name, maze in (("house", generate("house", 31, np.random.default_rng(0))), ("hall", field(31))):
            (tmp_path / f"{name}.txt").write_text(format_maze(maze))
        buildings = [f"house-changed-{number}" for number in (1, 2, 3, 4)]
        assert [maze.name for maze in Task.of("rebuilt", mazes=tmp_path).mazes] == buildings
        assert [line for line in remarks() if line.startswith("maze 'hall' left out: ")]
        (tmp_path / "house.txt").unlink()
        with pytest.raises(InputError, match=r"hall: expected a building in which .* at least 0.2 .*found 0.0"):
            Task.of("rebuilt", mazes=tmp_path)


class TestAgents:
    @pytest.mark.parametrize(
        ("name", "cell_size"),
        [("planner-closed-loop", 0.5), ("oracle", 0.4), ("oracle", 2.0), ("navigator", 0.5), ("navigator", 2.0)],
    )
    def test_agents_that_plan_drive_at_any_scale(self, name, cell_size):
        agent_class, maze = load_agent_class(name), dfs(9, cell_size)
        spec = Task.of(mazes=maze, context_size=agent_class.context_size(9), sensors=("lidar",))
        interface = Interface("local", 9, spec.context_size, sensors=spec.options.sensors, cell_size=cell_size)
        trials = dict(enumerate(draw_trials(spec, 1)))
        agent = agent_class.build(interface)
        played = run_trials(agent, spec, trials, 16, needs_truth=agent_class.needs_truth)
        results = [result for ended in played for result in ended]
        assert len(results) == len(trials)
        assert all(result.success for result in results)

    def test_a_scale_on_which_an_agent_did_not_learn_is_remarked(self, tmp_path):
        (tmp_path / "fine.txt").write_text(format_maze(generate("dfs", 13, np.random.default_rng(0))))
        options = {"mazes": str(tmp_path / "fine.txt"), "cell_size": 2.0, "distances": (1,), "episodes_per_distance": 1}
        with pytest.warns(Remark) as warned:
            assert mazebench.evaluate("mah", **options).untrained_scale
        assert [str(each.message) for each in warned] == [
            "mah learned on maps of 1 m a cell and may fail here: its map of 13 x 13 cells shows 13 x 13 cells of 2 m, "
            "2 m a cell"
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("error", Remark)
            mazebench.evaluate("planner", **options)

    @pytest.mark.parametrize("name", ["mah", "dqn"])
    def test_learned_agents_that_read_any_map_get_one_of_the_mazes_own_cells(self, tmp_path, name):
        (tmp_path / "large.txt").write_text(format_maze(generate("dfs", 31, np.random.default_rng(0))))
        plan = make_plan(eval_options(name, mazes=str(tmp_path / "large.txt")))
        assert (plan.task.context_size, plan.untrained_scale, plan.remark) == (31, False, None)

    def test_a_map_that_is_coarser_than_the_mazes_is_remarked(self, tmp_path):
        (tmp_path / "large.txt").write_text(format_maze(generate("dfs", 31, np.random.default_rng(0))))
        assert make_plan(eval_options("random", mazes=str(tmp_path / "large.txt"))).remark == (
            "random is shown the 31 x 31 cells as a map of 21 x 21; context_size() of its class chooses another one "
            "(docs/custom_agents.md)"
        )
        assert make_plan(eval_options("planner", mazes=str(tmp_path / "large.txt"))).remark is None
        assert make_plan(eval_options("random", task="building")).remark is None


class TestEnds:
    @pytest.mark.parametrize("start", ["1,3", (1, 3), "3.01m, 7.99 m"])
    def test_a_start_is_a_cell_or_a_point(self, start):
        spec = Task.of(mazes=field(9), start=start)
        episodes = [sample_episode(spec, np.random.default_rng(seed)) for seed in range(20)]
        assert {episode.start for episode in episodes} == {(1, 3)}
        assert len({episode.goal for episode in episodes}) > 5
        assert len({episode.yaw for episode in episodes}) == 20

    def test_the_other_end_is_drawn_at_the_distances(self):
        spec = Task.of(mazes=dfs(), goal=(7, 7), distances=(2, 5))
        for seed in range(20):
            episode = sample_episode(spec, np.random.default_rng(seed))
            assert episode.goal == (7, 7)
            assert spec.mazes[0].distance(episode.start, episode.goal) in (2, 5)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"start": "here"}, r"expected start as a cell 'row,column' or a point '1.5m,2.5m' \(x, y\), found 'here'"),
            ({"start": "0,0"}, r"start '0,0': dfs-0: expected a free cell, found \(0, 0\), a wall or outside"),
            ({"goal": "99m,1m"}, r"goal '99m,1m': dfs-0: expected a free cell.* outside, in the 9 x 9 m of the maze"),
            ({"start": (1, 1), "goal": "1,1"}, r"dfs-0: expected start and goal in different cells, found both in"),
            ({"start": (1, 1), "distances": (60,)}, r"dfs-0: expected distances of at most \d+ cells.*--distances"),
            ({"start": (1, 1), "goal": (7, 7), "distances": (2,)}, r"found distances \(2,\), which would be ignored"),
            ({"start": (1, 1), "pairs": "fixed"}, r"a start or a goal: expected pairs 'random', found 'fixed'"),
            ({"goal": (1, 1), "num_goals": 2}, r"num_goals 2: expected goal None, found '1,1'"),
            ({"start": (1, 1), "task": "building"}, r"track 'building': expected start None, found '1,1'"),
        ],
    )
    def test_ends_that_contradict_are_refused_in_a_line(self, options, message):
        with pytest.raises(InputError, match=message) as caught:
            Task.of(mazes=dfs(), **options)
        assert "\n" not in str(caught.value)


class TestDefaults:
    @pytest.mark.parametrize(
        ("maze", "distances", "time_limit"),
        [
            (field(7), (*range(1, 9),), 100),
            (corridor(), (*range(1, 7),), 100),
            # The diameter is 44, nine tenths of it 39.
            (field(25), (3, 5, 8, 10, 13, 16, 18, 21, 23, 26, 29, 31, 34, 36, 39), 6 * 39 + 50),
        ],
    )
    def test_distances_reach_as_far_as_the_map(self, maze, distances, time_limit):
        spec = Task.of(mazes=maze)
        assert (spec.distances, spec.options.time_limit) == (distances, time_limit)

    @pytest.mark.parametrize(("cell_size", "steps_a_cell"), [(0.5, 5), (1.0, 6), (3.0, 10)])
    def test_the_time_limit_grows_with_the_way(self, cell_size, steps_a_cell):
        maze = dataclasses.replace(field(25), cell_size=cell_size)
        assert Task.of(mazes=maze, distances=(20, 40)).options.time_limit == steps_a_cell * 40 + 50
        assert Task.of(mazes=maze, start=(1, 1), goal=(1, 21)).options.time_limit == steps_a_cell * 20 + 50
        assert Task.of("hierarchical", mazes=maze, landmark_distance=20).options.time_limit == steps_a_cell * 20 + 50
        assert Task.of(mazes=maze, time_limit=7).options.time_limit == 7


class TestEvaluation:
    def test_an_own_map_is_evaluated_without_distances(self, tmp_path):
        (tmp_path / "room.txt").write_text(ROOM)
        summary = mazebench.evaluate("planner", mazes=str(tmp_path / "room.txt"), episodes_per_distance=1)
        assert list(summary.by_distance) == [str(distance) for distance in range(1, 9)]
        assert summary.overall.success_rate == 1.0

    def test_given_ends_are_not_the_frozen_benchmark(self, tmp_path):
        options = {"start": "1,1", "goal": "11.5m,1.5m", "episodes_per_distance": 1}
        summary = mazebench.evaluate("planner-closed-loop", out=tmp_path, **options)
        assert (summary.task.split_in_results, summary.episodes) == ("custom", 20)
        assert summary.task.start == "1,1"
        records = load_result(tmp_path).records
        assert {(record.start, record.goal) for record in records} == {((1, 1), (11, 11))}
        assert {record.distance for record in records} == {20, 24, 28, 32, 36}
        assert all(record.oracle_steps <= record.steps for record in records)
        assert summary.overall.success_rate == 1.0

    def test_lengths_are_in_metres(self, scaled):
        summary, records = load_result(scaled).summary, load_result(scaled).records
        assert summary.task.cell_size == 0.5
        assert summary.overall.success_rate == 1.0
        for record in records:
            grid = record.distance * 0.5
            assert record.shortest_path <= grid
            assert record.spl_grid == pytest.approx(min(1.0, grid / max(grid, record.path_length)))
        assert json.loads((scaled / "episodes.jsonl").read_text().splitlines()[0])["cell_size"] == 0.5
        poses = load_trajectories(scaled / TRAJECTORIES)[0].pose
        np.testing.assert_allclose(poses[0, :2], dfs(13, 0.5).point(records[0].start), atol=0.01)

    def test_a_report_says_the_scale(self, scaled):
        (result,) = read_results([scaled])
        assert described(result.setting) == "local, 13 × 13, custom mazes, cells of 0.5 m"
