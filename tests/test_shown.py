"""An older map of one's own mazes, which is shown instead of them, and the tracks in cells that are not 1 m wide."""

from __future__ import annotations

import dataclasses
import json

import cv2
import numpy as np
import pytest
import yaml
from simple_mazes import field

import mazebench
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import make_plan
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.maps.readers.ros import write_ros_map
from mazebench.report.episodes import read_results
from mazebench.results.played import played_task
from mazebench.results.reading import load_result
from mazebench.tasks.episode import Episode, goals_of, sample_episode
from mazebench.tasks.perturbations.hand_drawing import HandDrawnMap, Line
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.task import Task
from mazebench.tasks.time_limit import default_time_limit
from mazebench.tasks.trials import draw_trials
from mazebench.world.bodies import SLIDER

HALL = dataclasses.replace(field(130), cell_size=0.5)
TASKS = [("local", 1), ("building", 1), ("building", 3), ("rebuilt", 1), ("adrift", 3), ("rough", 2)]


def house(seed: int = 0, cell_size: float = 1.0) -> Maze:
    return Maze(generate("house", 31, np.random.default_rng(seed)).walls, f"house-{seed}", cell_size)


def with_door(maze: Maze) -> np.ndarray:
    """The walls of an older map: a wall between two rooms is open, and a free cell is closed."""
    walls = maze.walls.copy()
    wall = next(cell for cell in np.argwhere(walls[1:-1, 1:-1]) + 1 if not walls[cell[0], cell[1] + [-1, 1]].any())
    walls[tuple(wall)] = False
    walls[tuple(maze.free_cells[0])] = True
    return walls


def options_of(task: str, level: int) -> dict:
    return {"task": task} if task == "local" else {"task": task, "level": level}


@pytest.mark.parametrize(("task", "level"), TASKS)
def test_an_older_map_is_shown_and_start_and_goal_are_free_on_both(task, level):
    maze = house()
    older = with_door(maze)
    spec = Task.of(**options_of(task, level), mazes=maze, shown=older)
    for seed in range(20):
        episode = sample_episode(spec, np.random.default_rng(seed))
        assert (show_map(spec, episode).walls == older).all()
        assert not older[episode.start]
        assert not older[episode.goal]


@pytest.mark.parametrize("task", ["local", "building"])
def test_the_maze_as_its_own_older_map_changes_no_byte(task, tmp_path):
    options = options_of(task, 1) | {"mazes": house(), "distances": (15, 20), "episodes_per_distance": 2}
    for name, shown in (("without", {}), ("with", {"shown": house()})):
        mazebench.evaluate("navigator", out=tmp_path / name, sensors=("lidar",), **options, **shown)
    without, with_older = ((tmp_path / name / "episodes.jsonl").read_bytes() for name in ("without", "with"))
    assert without == with_older


@pytest.mark.parametrize("options", [{}, {"task": "building", "num_goals": 5}, {"task": "rebuilt", "num_goals": 5}])
def test_areas_that_are_apart_on_the_older_map_hold_no_start_and_goal(options):
    older = field(9).walls.copy()
    older[:, 6] = True  # the right side is cut off
    spec = Task.of(mazes=field(9), shown=older, distances=(2, 8, 9), **options)
    for seed in range(30):
        episode = sample_episode(spec, np.random.default_rng(seed))
        assert all(column < 6 for _, column in (episode.start, *goals_of(spec, episode)))
    with pytest.raises(InputError, match="free and joined on the older map"):
        mazebench.make(spec).reset(options={"episode": Episode(0, (1, 1), (1, 7), 0.0, 0)})


def test_distances_are_those_of_cells_that_are_joined_on_both_maps(remarks):
    ring = np.ones((9, 9), bool)
    ring[[1, 7], 1:8] = ring[1:8, [1, 7]] = False
    older = ring.copy()
    older[[1, 7], 4] = True  # what is left of it and what is right of it are apart
    spec = Task.of(mazes=Maze(ring), shown=older)
    assert max(spec.distances) == 10
    assert draw_trials(spec, 1)
    assert "1.00 of the smaller free space is common with maze; 0 m2 are wall now, 2 m2 are free now" in remarks()[-1]
    with pytest.raises(InputError, match="at most 10 cells"):
        Task.of(mazes=Maze(ring), shown=older, distances=(11,))


def test_of_a_map_that_fits_badly_a_line_names_the_option_that_aligns(remarks):
    maze = house()
    Task.of(mazes=maze, shown=np.roll(maze.walls, 1, axis=1))
    assert "; few walls lie on each other: try --align" in remarks()[-1]


def test_a_report_has_results_with_an_older_map(tmp_path):
    options = {"mazes": house(), "shown": with_door(house()), "distances": (15,), "episodes_per_distance": 1}
    mazebench.evaluate("oracle", out=tmp_path / "run", **options)
    [result] = read_results([tmp_path / "run"])
    assert result.setting.shown == "an older map"


class TestRosMaps:
    """Maps of ROS are laid on each other by their origins."""

    def write(self, folder, name, maze, pixels, origin, crop=0, free_below=0):
        """Writes a map with so many pixels a cell, rows and columns cut off around it or free ones added below."""
        walls = np.pad(maze.walls, ((0, free_below), (0, 0)))
        walls = walls[crop : len(walls) - crop, crop : walls.shape[1] - crop]
        shades = np.where(walls, 0, 254).astype(np.uint8).repeat(pixels, 0).repeat(pixels, 1)
        cv2.imwrite(str(folder / f"{name}.pgm"), shades)
        x, y, yaw = origin
        metadata = {"image": f"{name}.pgm", "resolution": maze.cell_size / pixels, "origin": [x, y, yaw], "negate": 0}
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(metadata | {"occupied_thresh": 0.65, "free_thresh": 0.25}))
        return folder / f"{name}.yaml"

    @pytest.mark.parametrize("yaw", [0.0, 0.5])
    def test_a_part_in_other_pixels_lies_where_it_lay(self, tmp_path, yaw):
        maze = house(cell_size=0.5)
        new = self.write(tmp_path, "new", maze, 5, (3.0, -2.0, yaw))
        right, up = 0.5 * np.array([np.cos(yaw) - np.sin(yaw), np.sin(yaw) + np.cos(yaw)])  # by a cell along both axes
        old = self.write(
            tmp_path, "old", Maze(maze.walls, "old", 0.5), 10, (3.0 + float(right), -2.0 + float(up), yaw), crop=1
        )
        spec = Task.of("building", mazes=new, shown=old, cell_size=0.5)
        assert (spec.arena.shown[0].walls == spec.mazes[0].walls).all()

    def test_written_mazes_of_a_frame_register(self, tmp_path):
        maze, origin = house(cell_size=0.5), (3.0, -2.0, 0.0)
        old = self.write(tmp_path, "old", maze, 5, origin)
        older = Maze(with_door(maze), "new", 0.5)
        write_ros_map(older, tmp_path / "new.yaml", origin)
        spec = Task.of("building", mazes=tmp_path / "new.yaml", shown=old)
        assert (spec.mazes[0].walls == older.walls).all()
        assert (spec.arena.shown[0].walls == maze.walls).all()

    def test_a_map_is_laid_at_the_yaw_of_its_origin(self, tmp_path):
        maze = house(cell_size=0.5)
        new = self.write(tmp_path, "new", maze, 5, (0.0, 0.0, 0.0))
        quarter = Maze(np.rot90(maze.walls, -1), "old", 0.5)  # drawn clockwise, and turned back by its yaw
        old = self.write(tmp_path, "old", quarter, 5, (15.5, 0.0, np.pi / 2))
        task = Task.of("building", mazes=new, shown=old, cell_size=0.5)
        assert (task.arena.shown[0].walls == maze.walls).all()

    def test_another_place_is_refused_with_the_number(self, tmp_path):
        new = self.write(tmp_path, "new", house(cell_size=0.5), 5, (0.0, 0.0, 0.0))
        moved = self.write(tmp_path, "moved", house(cell_size=0.5), 5, (7.0, 0.0, 0.0))
        with pytest.raises(InputError, match=r"at least 0\.67 of the free space .* found 0\.\d\d; .* try --align"):
            Task.of("building", mazes=new, shown=moved)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"shown": np.zeros((31, 31))}, "expected mazes of your own beside it, found none"),
        ({"kinds": ("house",), "shown": np.zeros((31, 31))}, "expected mazes of your own beside it, found none"),
        (
            {"mazes": house(), "shown": house(1).walls[:-1]},
            "expected an older map of 31 x 31 cells, .* found 31 x 30 cells",
        ),
        ({"mazes": [house(0), house(1), house(2)], "shown": [house(0), house(1)]}, "each of 3 mazes, .* found 2"),
        ({"task": "rebuilt", "level": 2, "mazes": house(), "shown": house()}, "level 1 beside shown, .* found 2"),
        ({"mazes": house(), "shown": "plan.yaml"}, "a path beside the path of mazes, else values"),
        ({"mazes": house(), "shown": house(), "start": "0,0"}, "a wall or outside"),
        ({"task": "building", "mazes": house(cell_size=1.2)}, "expected cells of at most 1 m, found 1.2 m"),
        ({"task": "rough", "mazes": HALL, "shown": HALL}, "at most 127 cells a side.* found 130"),
    ],
)
def test_what_does_not_go_together_is_refused_in_a_line(options, message):
    with pytest.raises(InputError, match=message):
        Task.of(**options)


class TestMetres:
    """On a track, lengths are in metres, however wide a cell is."""

    def test_distances_and_limits_are_metres(self):
        maze = house()
        half = Maze(maze.walls.repeat(2, axis=0).repeat(2, axis=1), "half", 0.5)
        whole, fine = (Task.of("building", mazes=each, distances=(15, 20)) for each in (maze, half))
        assert (whole.distances, fine.distances) == ((15, 20), (30, 40))
        for task in (whole, fine):
            assert default_time_limit(max(task.distances), task.cell_size, SLIDER, track="building") == 170
        assert fine.options.distances == (15, 20)

    def test_records_keep_cells_and_summaries_have_metres(self, tmp_path):
        half = Maze(house().walls.repeat(2, axis=0).repeat(2, axis=1), "half", 0.5)
        options = {"mazes": half, "distances": (15, 16), "episodes_per_distance": 1}
        summary = mazebench.evaluate("random", "building", out=tmp_path / "run", **options)
        assert list(summary.by_distance) == ["15", "16"]
        record = json.loads((tmp_path / "run" / "episodes.jsonl").read_text().splitlines()[0])
        assert (record["distance"], record["cell_size"]) == (30, 0.5)

    def test_a_building_has_48_episodes(self):
        trials = draw_trials(Task.of("building", mazes=house()), None)
        assert len(trials) == 48
        assert {trial.distance for trial in trials} == set(range(15, 41))

    @pytest.mark.parametrize(
        ("share", "kind", "cells_of_a_door", "cell_size", "bend"),
        [
            (0.5, "house", 1, 1.0, 0.5),  # as on the track
            (1.0, "house", 1, 0.4, 0.4),
            (0.5, "", 1, 1.0, 0.5),
            (1.0, "", 2, 0.5, 1.0),
            (1.5, "", 2, 0.4, 1.2),
            (1.5, "", 3, 0.4, 1.5),  # the most
        ],
    )
    def test_a_hand_bends_the_map_by_a_share_of_the_width_of_doors(self, share, kind, cells_of_a_door, cell_size, bend):
        walls = np.kron(house().walls, np.ones((cells_of_a_door, cells_of_a_door), dtype=bool))
        shown = ShownMap(walls, kind=kind, cell_size=cell_size)
        drawing = HandDrawnMap(share).shown(shown, ((1, 1), (1, 1)), np.random.default_rng(0)).drawing
        moved = drawing.displacement.on_grid(Line(4 * len(walls) + 1, 4, cell_size=cell_size))
        assert np.linalg.norm(moved, axis=0).max() == pytest.approx(bend, rel=0.005)


class TestChangedBuildings:
    """On tracks whose doors have moved, mazes of one's own are plans of buildings that have changed since."""

    def test_a_plan_stands_for_four_buildings_whose_older_map_it_is(self):
        plan = house()
        spec = Task.of("rebuilt", mazes=plan)
        assert [maze.name for maze in spec.mazes] == [f"house-0-changed-{number}" for number in (1, 2, 3, 4)]
        assert all((older.walls == plan.walls).all() for older in spec.arena.shown)
        assert all(maze != plan for maze in spec.mazes)
        assert not any(spec.arena.joined(index)[maze.walls].any() for index, maze in enumerate(spec.mazes))
        assert Task.of("adrift", level=2, mazes=plan).mazes == Task.of("rebuilt", level=2, mazes=plan).mazes
        assert spec.replace(level=2).mazes != spec.mazes
        assert Task.of("building", mazes=plan).mazes == (plan,)

    @pytest.mark.parametrize("is_pair", [False, True])
    def test_the_time_limit_follows_the_shortest_way_in_the_building_not_on_the_older_map(self, is_pair):
        plan = house()
        building = Task.of("rebuilt", level=3, mazes=plan).mazes[0]
        own = {"mazes": building, "shown": plan} if is_pair else {"level": 3, "mazes": plan}
        env = mazebench.make(Task.of("rebuilt", **own))
        longer = 0
        for seed in range(20):
            env.reset(seed=seed)
            episode, rules = env.unwrapped.runner.episode, env.unwrapped.runner.rules
            way = env.unwrapped.task.mazes[episode.maze].distance(episode.start, episode.goal)
            assert rules.time_limit.item() == 6 * way + 50
            longer += plan.distance(episode.start, episode.goal) != way
        assert longer

    def test_the_same_buildings_are_played_again(self, tmp_path):
        options = {"mazes": house(), "distances": (15,)}
        assert len(make_plan(eval_options("random", "rebuilt", **options)).trials) == 4 * 48
        summary = mazebench.evaluate("oracle", "rebuilt", out=tmp_path / "run", episodes_per_distance=1, **options)
        assert summary.overall.on_time["1.25"] == 1
        result = load_result(tmp_path / "run")
        assert played_task(result.summary).mazes == Task.of("rebuilt", mazes=house()).mazes

    def test_levels_and_tracks_of_other_changes_do_not_go_together(self):
        with pytest.raises(InputError, match=r"expected one level in mazes of your own, .* found 1, 2"):
            Task.of("rebuilt", level=(1, 2), mazes=house())
        with pytest.raises(InputError, match="tracks building, rebuilt: expected tracks of one strength"):
            mazebench.make_vec(("building", "rebuilt"), 2, mazes=house())
        assert (
            mazebench.make_vec(("building", "rebuilt"), 2, mazes=house(), shown=house(), distances=(15,)).num_envs == 2
        )
