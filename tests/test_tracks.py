"""The tracks: what each shows, which senses they have, and that their files are frozen."""

from __future__ import annotations

import collections

import numpy as np
import pytest

import mazebench
from benchmarks.freeze_kinds import freeze_kinds
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.plan import make_plan
from mazebench.maps.benchmark import (
    DEV,
    MANIFEST,
    TRACKS_BENCHMARK,
    load_kind_mazes,
    manifest,
    read_asset,
)
from mazebench.maps.kinds import KNOWN, NOVEL, generate
from mazebench.maps.maze import canonical_bytes
from mazebench.tasks.context import GLOBAL_MAP, GOAL, LOCAL_MAP, START
from mazebench.tasks.episode import Episode, sample_episode
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.perturbations.turned_map import TurnedMap
from mazebench.tasks.shown_map import is_blocked, leg_context, show_map
from mazebench.tasks.streams import TRACK_NAMES
from mazebench.tasks.task import Task
from mazebench.tasks.time_limit import default_time_limit
from mazebench.tasks.tracks import LEVELS, TRACKS
from mazebench.tasks.trials import frozen_trials
from mazebench.world.bodies import SLIDER
from mazebench.world.ray_casting import TURTLEBOT3
from tests.simple_mazes import field

PLAYED = [(name, level) for name in TRACKS for level in LEVELS]


def test_each_track_that_is_named_is_there():
    assert tuple(TRACKS) == TRACK_NAMES


def episodes(spec: Task, count: int = 20) -> list[Episode]:
    rng = np.random.default_rng(0)
    return [sample_episode(spec, rng) for _ in range(count)]


def context(spec: Task, episode: Episode) -> np.ndarray:
    return leg_context(spec, show_map(spec, episode), episode.start, episode.goal)


class TestFiles:
    @pytest.mark.slow
    def test_one_command_makes_them_byte_for_byte(self, tmp_path):
        freeze_kinds(tmp_path, manifest(TRACKS_BENCHMARK)["generator"]["eval_commit"])
        made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
        assert set(made) == {*manifest(TRACKS_BENCHMARK)["files"], MANIFEST}
        for name in manifest(TRACKS_BENCHMARK)["files"]:
            assert made[name] == read_asset(name, TRACKS_BENCHMARK).encode("ascii"), name

    def test_mazes_are_new_with_far_goals_and_only_eval_has_novel_kinds(self):
        mazes = [maze for split in ("train", DEV, "eval") for maze in load_kind_mazes(split)]
        assert collections.Counter(maze.kind for maze in mazes) == dict.fromkeys(KNOWN, 40) | dict.fromkeys(NOVEL, 8)
        assert len({canonical_bytes(maze.walls) for maze in mazes}) == len(mazes)
        assert min(maze.diameter for maze in mazes) >= 40

    @pytest.mark.parametrize("split", [DEV, "eval"])
    def test_five_pairs_in_each_maze(self, split):
        trials, mazes = frozen_trials("local", 31, TRACKS_BENCHMARK, split), load_kind_mazes(split)
        assert collections.Counter(trial.episode.maze for trial in trials) == dict.fromkeys(range(48), 5)
        for trial in trials:
            maze = mazes[trial.episode.maze]
            assert maze.distance(trial.episode.start, trial.episode.goal) == trial.distance
        assert {trial.distance for trial in trials} == set(range(15, 41))

    def test_the_split_dev_belongs_to_the_tracks(self):
        with pytest.raises(InputError, match="split"):
            Task.of(size=13, split="dev")


@pytest.mark.parametrize(("track", "level"), PLAYED)
def test_the_task_of_a_level(track, level):
    spec = Task.of(track, level=level)
    assert (spec.size, spec.options.lidar, spec.options.sensors) == (31, TURTLEBOT3, ("lidar",))
    assert spec.context_size == (62 if track == "rough" else 31)
    is_lost = track in ("adrift", "rough")
    assert spec.interface.odometry_noise == ((0.01, 0.05, 0.2)[level - 1] if is_lost else 0.0)
    expected = 420 if track == "doors" else 270 if is_lost else 170
    assert default_time_limit(20, 1.0, SLIDER, track=track) == expected
    env = mazebench.load(track, level=level, seed=0)
    state = env.reset().observation["state"]
    assert (state[[0, 1, 5]] == 0).all() == is_lost


class TestBuilding:
    @pytest.mark.parametrize(("level", "num_maps"), [(2, 4), (3, 8)])
    def test_the_sheet_lies_in_any_way_and_the_goal_with_it(self, level, num_maps):
        spec = Task.of("building", level=level)
        seen = set()
        for episode in episodes(spec, 100):
            maze, planes = spec.mazes[episode.maze], context(spec, episode)
            assert not planes[[LOCAL_MAP, START]].any()
            marked = maze.walls.astype(int)
            marked[episode.goal] = 2
            maps = [np.rot90(grid, turns) for grid in (marked, marked[:, ::-1]) for turns in range(4)]
            shown = planes[GLOBAL_MAP] + 2 * planes[GOAL]
            (lies,) = (index for index, lain in enumerate(maps) if (lain == shown).all())
            seen.add(lies)
        assert seen == set(range(num_maps))

    @pytest.mark.parametrize("seed", range(4))
    def test_points_and_cells_lie_at_the_same_place_of_the_map(self, seed):
        maze = generate("house", 21, np.random.default_rng(seed))
        turned, rng = TurnedMap(turns=True, mirrors=True), np.random.default_rng(seed)
        shown = turned.shown(ShownMap(maze.walls), ((1, 1), (1, 1)), rng)
        cell = tuple(maze.free_cells[seed].tolist())
        x, y = shown.seen_points(np.array([[cell[1] + 0.5, 21 - cell[0] - 0.5]]))[0]
        assert (int(21 - y), int(x)) == shown.seen_cell(cell)
        assert not shown.seen_walls[shown.seen_cell(cell)]


class TestRebuilt:
    @pytest.mark.parametrize(("level", "share"), [(1, 0.45), (2, 0.7), (3, 0.9)])
    def test_so_many_doors_moved_that_the_share_of_paths_is_blocked(self, level, share):
        plan = make_plan(eval_options("random", task="rebuilt", level=level, split=DEV))
        blocked = [
            is_blocked(plan.task.mazes[trial.episode.maze].walls, show_map(plan.task, trial.episode).walls, ends(trial))
            for trial in plan.trials
        ]
        assert abs(np.mean(blocked) - share) < 0.08

    def test_a_path_through_a_new_wall_is_blocked_and_one_beside_it_is_not(self):
        ends, shown = ((1, 1), (1, 5)), field(7).walls
        for wall, expected in (((1, 3), True), ((2, 3), False)):
            world = shown.copy()
            world[wall] = True
            assert is_blocked(world, shown, ends) == expected

    def test_drawn_mazes_without_doors_are_refused_in_a_line(self):
        with pytest.raises(InputError, match=r"expected a kind of dfs, house, .*, found kind 'cave'"):
            Task.of("rebuilt", kinds=("cave",), size=31, distances=(2,))


def ends(trial) -> tuple:
    return trial.episode.start, trial.episode.goal


class TestAdriftAndRough:
    def test_the_pose_is_the_true_one_with_exact_pose(self):
        for exact in (False, True):
            env = mazebench.make_vec("adrift", 2, level=3, seed=1, exact_pose=exact)
            observation, info = env.reset()
            for action in (0, 0, 4, 0):
                observation, *_, info = env.step(np.full(2, action))
            is_true = np.allclose(observation["state"][:, :2], info["position"], atol=1e-5)
            assert is_true == exact
            env.close()

    def test_exact_pose_belongs_to_lost_poses(self):
        with pytest.raises(InputError, match="'rebuilt': expected no exact_pose"):
            Task.of("rebuilt", exact_pose=True)
        with pytest.raises(InputError, match="exact_pose: expected a track whose pose is odometry"):
            Task.of(exact_pose=True)

    def test_a_rough_sheet_is_mirrored_in_half_of_the_episodes_of_level_3(self):
        straight, mirrored = (Task.of("rough", level=level) for level in (2, 3))
        drawn = [show_map(mirrored, episode).drawing for episode in episodes(mirrored, 40)]
        assert 8 < sum(each.is_mirrored for each in drawn) < 32
        assert not any(hasattr(show_map(straight, episode).drawing, "quarters") for episode in episodes(straight, 3))


def test_summaries_have_the_figures_of_each_kind_and_of_blocked_episodes(tmp_path):
    summary = evaluate("planner-closed-loop", out=tmp_path / "run", task="rebuilt", split=DEV, distances=(15,))
    assert list(summary.by_fact) == ["blocked", "not blocked", *KNOWN]
    assert sum(summary.by_fact[kind].n for kind in KNOWN) == summary.episodes
    assert summary.benchmark == "tracks"
