"""Doors that close and open while one drives: their schedules, what stands, and the drivers that know them."""

from __future__ import annotations

import copy
import json
import pickle

import numpy as np
import pytest
from mazebench_agents.planner import HurryingOracle, Oracle, WaitingDriver

import mazebench
from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.evaluation.chunk import run_trials
from mazebench.maps.benchmark import DEV, DOORS_BENCHMARK, load_kind_mazes, manifest
from mazebench.maps.maze import Maze
from mazebench.maps.moving_doors import ChangingMazes, MovedMaze, is_joined, moved_walls, moving_doors
from mazebench.tasks.episode import Episode, sample_episode, schedule_of
from mazebench.tasks.perturbations.moving_doors import MovingDoors, doors_on_way
from mazebench.tasks.schedule import DoorTimes, Schedule, braking_way, moved_along, schedules_hash
from mazebench.tasks.task import Task
from mazebench.tasks.tracks import LEVELS
from mazebench.tasks.trials import Trial, select_trials
from mazebench.world.bodies import SLIDER
from mazebench.world.looks import VARIED, look_of

# Two rooms side by side, with a door in the row of start and goal and one far below.
PLAN = """
#############
#.....#.....#
#.....#.....#
#...........#
#.....#.....#
#.....#.....#
#.....#.....#
#.....#.....#
#.....#.....#
#.....#.....#
#...........#
#.....#.....#
#############
"""
START, GOAL = (3, 1), (3, 11)
NEAR, FAR = (3, 6), (10, 6)


def two_rooms(name: str = "two-rooms") -> Maze:
    return Maze(np.array([[cell == "#" for cell in row] for row in PLAN.split()]), name)


def number_of(maze: Maze, cell: tuple[int, int]) -> int:
    return next(number for number, door in enumerate(moving_doors(maze)) if (door.top, door.left) == cell)


class TestDoors:
    def test_passages_of_a_building_of_ones_own_and_slots_of_a_kind(self):
        maze = two_rooms()
        assert {(door.top, door.left) for door in moving_doors(maze) if door.is_open} == {NEAR, FAR}
        for maze in load_kind_mazes(DEV)[::12]:
            doors = moving_doors(maze)
            assert 20 <= sum(door.is_open for door in doors) <= 26
            assert sum(not door.is_open for door in doors) <= 6
            assert all((maze.walls[door.cells()] != door.is_open).all() for door in doors)

    def test_what_stands_has_the_walls_of_its_number_and_an_unchanged_look(self):
        maze = two_rooms()
        mazes, near = ChangingMazes((maze, maze)), number_of(maze, NEAR)
        stands = mazes[1 + (2 << near)]
        assert isinstance(stands, MovedMaze)
        assert stands.as_built is maze
        assert np.argwhere(stands.walls != maze.walls).tolist() == [list(NEAR)]
        covered = np.zeros_like(maze.walls, dtype=int)
        for top, left, bottom, right in stands.boxes:
            covered[top:bottom, left:right] += 1
        np.testing.assert_array_equal(covered, stands.walls)
        before, after = (look_of(each, VARIED, "train") for each in (maze, stands))
        assert all(np.array_equal(*pair) for pair in zip(before[1:], after[1:], strict=True))
        assert np.argwhere(before.grid != after.grid).tolist() == [[12 - NEAR[0], NEAR[1]]]
        assert pickle.loads(pickle.dumps(stands)).walls[NEAR]  # noqa: S301


class TestSchedule:
    def schedule(self, **times: DoorTimes) -> Schedule:
        maze = two_rooms()
        cells = {"near": NEAR, "far": FAR}
        by_number = {number_of(maze, cells[name]): each for name, each in times.items()}
        return Schedule(moving_doors(maze), by_number, braking_way(SLIDER), maze.size, maze.cell_size)

    def test_a_door_is_due_in_each_of_its_periods(self):
        schedule = self.schedule(near=DoorTimes(10, 5, 20), far=DoorTimes(12))
        near, far = (1 << number_of(two_rooms(), cell) for cell in (NEAR, FAR))
        for step in (*range(100), *range(1000, 1100)):
            expected = near * (step >= 10 and (step - 10) % 20 < 5) + far * (step >= 12)
            due, until = schedule.due(step)
            assert due == expected
            assert all(schedule.due(later)[0] == due for later in range(step, until))

    def test_a_door_waits_for_the_body_to_leave_and_opens_in_time(self):
        schedule = self.schedule(near=DoorTimes(2, 6))
        points = [(x, 9.5) for x in (4.0, 4.5, 5.0, 5.5, 7.5, 8.2, 8.3, 9.0, 9.0)]  # the door is from 6 to 7
        assert [bool(moved) for moved in moved_along(schedule, points)] == [False] * 6 + [True] * 2 + [False]

    @pytest.mark.parametrize("level", LEVELS)
    def test_the_building_stays_passable_and_the_map_is_right_at_first(self, level):
        task, rng = Task.of("doors", level=level), np.random.default_rng(level)
        for episode in (sample_episode(task, rng) for _ in range(30)):
            maze, schedule = task.mazes[episode.maze], schedule_of(task, episode)
            assert schedule.due(0)[0] == 0
            assert doors_on_way(maze, episode.start, episode.goal)[1]
            ends = [
                schedule.distance(number, tuple(maze.point(cell).tolist()))
                for number in schedule.times
                for cell in (episode.start, episode.goal)
            ]
            assert min(ends) > 0
            if level == 1:
                assert is_joined(moved_walls(maze.walls, [schedule.doors[number] for number in schedule.times]))
            else:
                assert all(times.period - times.away >= 48 for times in schedule.times.values())

    def test_where_the_building_would_part_another_door_opens(self):
        walls = two_rooms().walls.copy()
        walls[FAR] = True
        task = Task.of("doors", mazes=Maze(walls), distances=(10,))
        schedule = schedule_of(task, Episode(0, START, GOAL, 0.0, 1))
        closes, opens = sorted(schedule.times, key=lambda number: -schedule.doors[number].is_open)[:2]
        assert schedule.doors[closes][:2] == NEAR
        assert not schedule.doors[opens].is_open
        assert schedule.times[closes] == schedule.times[opens]

    def test_a_maze_without_a_door_is_refused(self):
        walls = np.ones((9, 9), dtype=bool)
        walls[1:-1, 1:-1] = False
        with pytest.raises(
            mazebench.errors.InputError, match="expected a door or a passage that can close, found none"
        ):
            MovingDoors(opens=True).require(Maze(walls))


def drive(env, actions):
    """What a single environment shows of each step."""
    for action in actions:
        step = env.step(action)
        observation = step[0] if isinstance(env, MazeEnv) else step.observation
        rules = (env.runner if isinstance(env, MazeEnv) else env.task).rules
        yield observation["state"], observation["lidar"], rules.maze.item(), rules.pose[0].copy()


@pytest.mark.parametrize("level", LEVELS)
class TestEnvironments:
    ACTIONS = np.random.default_rng(0).choice(6, size=150, p=[0.5, 0.1, 0.1, 0.1, 0.1, 0.1])

    def task(self, level: int) -> Task:
        return Task.of("doors", level=level, split="dev")

    def test_all_play_the_same_episode_whoever_is_beside(self, level):
        task = self.task(level)
        envs = MazeVectorEnv(task, 9, num_threads=1)
        envs.reset(seed=3)
        expected = []
        for action in self.ACTIONS:
            observation, *_ = envs.step(np.full(9, action))
            expected.append(
                (observation["state"][4], observation["lidar"][4], envs.rules.maze[4], envs.rules.pose[4].copy())
            )
        assert len({number for _, _, number, _ in expected}) > 1
        for env in (MazeEnv(task), Environment(task)):
            env.reset(seed=7)
            for values, wanted in zip(drive(env, self.ACTIONS), expected, strict=True):
                for value, other in zip(values, wanted, strict=True):
                    np.testing.assert_array_equal(value, other)

    def test_states_and_copies_go_on_with_the_same_doors(self, level):
        env = MazeEnv(self.task(level))
        env.reset(seed=7)
        list(drive(env, self.ACTIONS[:60]))
        state, copied = pickle.loads(pickle.dumps(env.get_state())), copy.deepcopy(env)  # noqa: S301
        wanted = list(drive(env, self.ACTIONS[60:]))
        env.set_state(state)
        for each in (env, copied):
            for values, others in zip(drive(each, self.ACTIONS[60:]), wanted, strict=True):
                assert all(np.array_equal(*pair) for pair in zip(values, others, strict=True))

    def test_no_door_closes_on_the_body_nor_in_its_braking_way(self, level):
        task = self.task(level)
        envs = MazeVectorEnv(task, 16, num_threads=1)
        envs.reset(seed=0)
        for action in self.ACTIONS:
            before, schedules = envs.rules.maze.copy(), envs.rules.schedules()
            *_, info = envs.step(np.full(16, action))
            for i in np.flatnonzero((envs.rules.maze != before) & (envs.rules.steps > 0)):
                moved = before[i] // len(task.mazes) ^ envs.rules.maze[i] // len(task.mazes)
                walls = task.standing[envs.rules.maze[i]].walls
                for number, door in enumerate(schedules[i].doors):
                    if moved >> number & 1 and walls[door.cells()].all():
                        assert schedules[i].distance(number, envs.rules.pose[i, :2].tolist()) >= 1.2
            assert not any(
                task.standing[maze].walls.flat[cell]
                for maze, cell in zip(envs.rules.maze, envs.rules.cell, strict=True)
            )
        assert (info["maze"] < len(task.mazes)).all()


class TestReferences:
    @staticmethod
    def drives(times: DoorTimes, monkeypatch) -> dict[str, tuple[bool, int, int]]:
        """Success, steps and waited steps of each driver, where the near door moves."""
        monkeypatch.setattr(MovingDoors, "times", lambda self, maze, ends, rng: {number_of(maze, NEAR): times})
        task = Task.of("doors", level=2, mazes=two_rooms(), distances=(10,))
        trial = Trial(Episode(0, START, GOAL, 0.0, 1), 10, 9.5)
        found = {}
        for driver in (Oracle, HurryingOracle, WaitingDriver):
            [[result]] = [
                each for each in run_trials(driver.build(task.interface), task, {0: trial}, 1, needs_truth=True) if each
            ]
            found[driver.__name__] = result.success, result.steps, result.waited
        return found

    def test_a_short_closing_is_waited_for_and_who_hurries_goes_around(self, monkeypatch):
        found = self.drives(DoorTimes(4, 14), monkeypatch)
        assert all(success for success, *_ in found.values())
        oracle, hurrying, waiting = found.values()
        assert oracle[1] <= waiting[1] < hurrying[1]
        assert waiting[2] >= 2 > hurrying[2]

    def test_a_door_that_stays_closed_is_driven_around_by_who_knows(self, monkeypatch):
        oracle, hurrying, waiting = self.drives(DoorTimes(4), monkeypatch).values()
        assert oracle[0]
        assert oracle[:2] == hurrying[:2]
        assert oracle[2] <= 1
        assert not waiting[0]


class TestFrozen:
    @pytest.mark.parametrize("split", [DEV, "eval"])
    @pytest.mark.parametrize("level", LEVELS)
    def test_the_times_of_all_doors_have_the_hash_of_the_manifest(self, level, split):
        task = Task.of("doors", level=level, split=split)
        trials = select_trials(task)
        schedules = [schedule_of(task, trial.episode) for trial in trials]
        assert len(schedules) == 240
        assert (
            schedules_hash(schedules) == manifest(DOORS_BENCHMARK)["generator"]["schedules_sha256"][f"{level}-{split}"]
        )
        assert all(trial.oracle_steps for trial in trials)

    @pytest.mark.slow
    @pytest.mark.parametrize("split", [DEV, "eval"])
    def test_the_oracle_waits_in_about_half_of_the_episodes_of_level_2(self, split):
        task = Task.of("doors", level=2, split=split)
        trials = dict(enumerate(select_trials(task)))
        steps = run_trials(Oracle.build(task.interface), task, trials, 32, needs_truth=True)
        results = {result.number: result for several in steps for result in several}
        assert [results[number].steps for number in trials] == [trial.oracle_steps for trial in trials.values()]
        assert 0.4 <= np.mean([result.waited >= 4 for result in results.values()]) <= 0.6


def test_an_evaluation_in_a_building_of_ones_own_keeps_the_schedule(tmp_path):
    mazebench.evaluate(
        "random", "doors", level=2, mazes=two_rooms(), distances=(10,), episodes_per_distance=2, out=tmp_path / "run"
    )
    records = [json.loads(line) for line in (tmp_path / "run/episodes.jsonl").read_text().splitlines()]
    task = Task.of("doors", level=2, mazes=two_rooms(), distances=(10,))
    for record in records:
        episode = Episode(0, tuple(record["start"]), tuple(record["goal"]), 0.0, record["seed"])
        assert record["doors"] == schedule_of(task, episode).rows()
        assert record["waited"] <= record["steps"]


def test_goals_in_a_row_are_played_with_the_same_doors():
    envs = mazebench.make_vec("doors", 2, level=3, num_goals=3, seed=0)
    envs.reset()
    for _ in range(30):
        envs.step(np.zeros(2, dtype=int))
    assert (envs.rules.maze >= 0).all()
    assert all(envs.rules.schedules())
