"""The navigator: its planning and driving, and what it reaches where the map or the senses are wrong."""

from __future__ import annotations

import numpy as np
import pytest
from acting import inputs_of
from mazebench_agents.navigator.navigator import Robot
from mazebench_agents.robot import planning
from mazebench_agents.robot.driving import Drive
from mazebench_agents.robot.map_matching import MapBelief
from mazebench_agents.robot.moving_body import FORWARD, MovingBody
from mazebench_agents.robot.senses import Memory
from run_folders import records_of

import mazebench
from mazebench.agent import Interface, Truth
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.chunk import Result, run_trials
from mazebench.evaluation.measured_oracle import measure_oracle_steps
from mazebench.maps.benchmark import load_kind_mazes, load_mazes
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials
from mazebench.world.bodies import SLIDER


def ring(size: int = 7) -> np.ndarray:
    """`[N, N]` float: certain walls but for a ring of free cells along the border."""
    walls = np.ones((size, size))
    walls[1:-1, 1:-1] = 0.0
    walls[2:-2, 2:-2] = 1.0
    return walls


def goal_at(*cells: tuple[int, int], size: int = 7) -> np.ndarray:
    goal = np.zeros((size, size))
    goal[tuple(np.transpose(cells))] = 1 / len(cells)
    return goal


class TestPlanning:
    def test_path_is_a_shortest_one(self):
        assert planning.plan(ring(), goal_at((1, 4)), (1, 1)) == [(1, 1), (1, 2), (1, 3), (1, 4)]

    @pytest.mark.parametrize(("probability", "length"), [(0.1, 3), (0.5, 3), (0.98, 13)])
    def test_an_uncertain_cell_is_tried_where_the_detour_is_long(self, probability, length):
        walls = ring()
        walls[1, 3] = probability
        assert len(planning.plan(walls, goal_at((1, 4)), (1, 1))) == 1 + length

    def test_the_likeliest_goals_are_searched_first_and_near_ones_before_far_ones(self):
        goal = goal_at((1, 3), (1, 5))
        assert planning.plan(ring(), goal, (1, 1))[-1] == (1, 3)
        goal[1, 3] = 0.01
        assert planning.plan(ring(), goal, (1, 1))[-1] == (1, 5)


class TestDriving:
    def test_a_drive_is_followed_until_the_body_is_off_it(self):
        blocked = ring() > 0.5
        path = planning.plan(ring(), goal_at((5, 5)), (1, 1))
        drive, body = Drive(), MovingBody(SLIDER, x=1.5, y=5.5, yaw=0.0, forward=0.0, left=0.0)
        action, (x, y) = drive.next(blocked, path, body, 1.0)
        assert action == FORWARD
        assert 1.6 < x < 2.2
        assert y == pytest.approx(5.5, abs=0.1)
        left = list(drive.actions)
        assert drive.next(blocked, path, body._replace(x=x, y=y), 1.0)[0] == left[0]
        assert drive.actions == left[1:]
        assert drive.next(blocked, path, body, 1.0) == (action, (x, y))


def play(spec: Task, trials: list) -> list[Result]:
    """The results of the navigator, in the order of the trials."""
    agent = load_agent_class("navigator").build(spec.interface)
    played = run_trials(agent, spec, dict(enumerate(trials)), 64)
    return sorted(result for results in played for result in results)


def success_rate(results: list[Result]) -> float:
    return float(np.mean([result.success for result in results]))


class TestNavigator:
    def test_goals_are_reached_where_the_map_is_true(self):
        mazes = load_mazes(13, "train")[:4]
        distances = tuple(range(1, 16))
        spec = Task.of(mazes=mazes, distances=distances, sensors=("lidar",), time_limit=100)
        assert success_rate(play(spec, draw_trials(spec, 2))) == 1.0

    @pytest.mark.parametrize(
        ("track", "level", "least", "options"),
        [
            ("building", 1, 1.0, {}),
            ("building", 1, 0.9, {"hide": ("map",)}),
            ("rebuilt", 1, 0.9, {"odometry_noise": 0.2}),
            ("rebuilt", 2, 0.9, {}),
            ("rebuilt", 3, 0.9, {"lidar_noise": ".1,.1"}),
            ("adrift", 3, 0.8, {}),
        ],
    )
    def test_goals_are_reached_in_buildings_with_noisy_senses_or_without_a_map(self, track, level, least, options):
        mazes = load_kind_mazes("train")
        spec = Task.of(track, mazes=mazes[:: len(mazes) // 6], level=level, distances=(15, 25), **options)
        assert success_rate(play(spec, draw_trials(spec, 2))) >= least

    def test_smaller_cells_cost_no_time(self):
        walls = np.kron(generate("house", 15, np.random.default_rng(0)).walls, np.ones((2, 2), dtype=bool))
        spec = Task.of(mazes=(Maze(walls, cell_size=0.5),), distances=(20, 24, 28), sensors=("lidar",), context_size=30)
        trials = draw_trials(spec, 4)
        steps = sum(result.steps for result in play(spec, trials))
        assert steps <= 1.04 * sum(measure_oracle_steps(spec, trials))

    def test_near_goals_are_found_without_a_map_and_a_mark(self):
        mazes, hide = load_mazes(13, "train")[::2], ("map", "goal")
        spec = Task.of(mazes=mazes, distances=(3, 5), sensors=("lidar",), time_limit=200, hide=hide)
        assert success_rate(play(spec, draw_trials(spec, 2))) >= 0.7

    def test_a_landmark_in_a_wall_is_given_up(self):
        # Landmarks are planned on the shown map, and some of them lie in walls. The legs to them time out.
        mazes = load_mazes(13, "train")[:20]
        spec = Task.of("hierarchical", mazes=mazes, map_flip=0.1, sensors=("lidar",), time_limit=100)
        assert success_rate(play(spec, draw_trials(spec))) >= 0.9

    @pytest.mark.parametrize("perturbation", [{"position_noise": 0.5}, {"map_warp": 0.1}], ids=["noise", "warp"])
    def test_goals_are_reached_where_positions_or_marks_are_off(self, perturbation):
        mazes = load_mazes(13, "train")[:5]
        spec = Task.of(mazes=mazes, distances=(5, 10), sensors=("lidar",), time_limit=100, **perturbation)
        assert success_rate(play(spec, draw_trials(spec, 2))) >= 0.9


class TestReferences:
    def test_the_told_navigator_follows_the_map_until_a_wall_is_seen_on_its_path(self):
        shown, true = ring(), ring()
        true[1, 3] = 1.0
        context = np.stack([shown, shown, goal_at((1, 4)), goal_at((1, 1))])
        truth = Truth(true[None] > 0.5, np.zeros((1, 3)), np.array([[1, 4]]))
        inputs = inputs_of({"context": context[None]}, np.array([True]))._replace(truth=truth)
        memory = Memory(
            MapBelief(shown, goal_at((1, 4)), 1, None, 7), MovingBody(SLIDER, 1.5, 5.5, 0.0, 0.0, 0.0), 0.01, 1.0
        )
        agent = load_agent_class("navigator-told").build(Interface("local", 7, 7))
        for seen, expected in ((None, shown), ((2, 3), shown), ((1, 3), true)):
            if seen:
                memory.evidence[seen] = 5.0
            np.testing.assert_array_equal(agent.estimate(Robot(memory), inputs, 0)[0], expected)

    def test_the_told_navigator_is_privileged(self):
        found = mazebench.evaluate("navigator-told", "rebuilt", level=3, split="dev", distances=(15,))
        assert (found.privileged, found.overall.success_rate) == (True, 1.0)

    @pytest.mark.parametrize("track", ["adrift", "rough"])
    def test_the_told_navigator_refuses_a_map_that_may_lie_in_any_way(self, track):
        expected = "agent 'navigator-told': expected a map that lies as the maze does"
        with pytest.raises(mazebench.UnplayableError, match=expected):
            mazebench.evaluate("navigator-told", track, split="dev", distances=(15,))

    def test_without_memory_the_navigator_drives_to_later_goals_longer(self, tmp_path):
        options = {"task": "rebuilt", "level": 3, "split": "dev", "distances": (15,), "num_goals": 3}
        agents = "navigator", "navigator-without-memory"
        for agent in agents:
            assert mazebench.evaluate(agent, out=tmp_path / agent, **options).overall.success_rate == 1.0
        steps = [np.array([each["steps"] for each in records_of(tmp_path / agent)]).reshape(-1, 3) for agent in agents]
        np.testing.assert_array_equal(steps[0][:, 0], steps[1][:, 0])
        assert steps[0][:, 1:].sum() < steps[1][:, 1:].sum()
