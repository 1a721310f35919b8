"""Mazes from arrays and .npy files."""

from __future__ import annotations

import warnings

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

import mazebench
from mazebench.errors import InputError, Remark
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, MazeError
from mazebench.maps.readers.arrays import maze_from_array

# What grids may hold, each as the values of its type.
POOLS = [np.array(values) for values in ([False, True], [0, 1], [-1, 0, 1], [0.0, 1, np.nan], [0, 1 - 1e-12], [np.inf])]
POOLS += [
    np.array(values) for values in (["#", "."], ["", "#", "\ud800", "\n"], [b"#", b"\xe9"], ["##"], [1j], [2**63])
]
POOLS += [np.array([-1, 0, 40, 100]).astype(kind) for kind in ("i1", ">i4", "u1", "f2", ">f8", "m8[s]", object)]
SHAPES = st.lists(st.integers(0, 12), max_size=3) | st.sampled_from([[1, 5000], [3, 1100], [5000, 3]])
WALLS = generateWALLS = generate("dfs", 7, np.random.default_rng(0)).walls


class TestWalls:
    @pytest.mark.parametrize("dtype", [bool, np.uint8, np.int64, np.float64])
    def test_walls_are_true_or_one(self, dtype):
        assert maze_from_array(WALLS.astype(dtype)) == Maze(WALLS)

    def test_a_rectangle_is_padded_with_wall_and_one_line_says_so(self, remarks):
        walls = np.ones((9, 15), dtype=bool)
        walls[1:-1, 1:-1] = False
        maze = maze_from_array(walls, "hall")
        assert (maze.walls[:9] == walls).all()
        assert maze.walls[9:].all()
        assert remarks() == [
            "hall: 9 x 15 cells padded with wall to 15 x 15; the maze's lower left corner is (0, -6) m on the map, "
            "so its point (x, y) is (x, y + 6) m in the maze"
        ]

    @pytest.mark.parametrize(
        ("array", "message"),
        [
            (np.zeros(5), "expected a two-dimensional array of numbers, found shape (5,) float64"),
            (np.where(WALLS, 1 - 1e-12, 0), "found float64 with the values 0.0, 0.999999999999; "),
            (np.zeros((3, 60_000)), "expected at most 1024 cells a side, found 3 x 60000"),
            (np.frombuffer(b"\xff" * 100, "<U1").reshape(5, 5), "expected a two-dimensional array of numbers"),
            (np.full((5, 5), "##"), "expected a two-dimensional array of numbers, found shape (5, 5) <U2"),
            (
                np.full((5, 5), 0.5),
                "or occupancy as -1, 0 and 1 or as per cent up to 100, found float64 with the values 0.5",
            ),
            (np.arange(25).reshape(5, 5) * 11, "found int64 with the values 0, 11, 22, 33, 44, 55, ... 264"),
            (WALLS + 2 * np.eye(len(WALLS), dtype=int), "`array == VALUE` says which are walls"),
        ],
    )
    def test_another_array_is_refused(self, array, message):
        with pytest.raises(MazeError) as caught:
            maze_from_array(array)
        assert message in str(caught.value)

    def test_characters_are_those_of_text_as_bytes_too(self):
        assert maze_from_array(np.where(WALLS, b"#", b".")) == maze_from_array(np.where(WALLS, "#", ".")) == Maze(WALLS)

    @given(st.sampled_from(POOLS), SHAPES, st.integers(0, 2**32 - 1), st.booleans())
    @settings(max_examples=200, deadline=None)
    def test_any_grid_is_a_maze_or_refused_in_one_line(self, pool, shape, seed, is_masked):
        rng = np.random.default_rng(seed)
        array = rng.choice(pool, shape)
        array = np.ma.array(array, mask=rng.random(shape) < 0.2) if is_masked else array
        with warnings.catch_warnings(action="error"), np.errstate(all="raise"):
            warnings.simplefilter("ignore", Remark)
            try:
                said = str(maze_from_array(array).size)
            except InputError as error:
                said = str(error)
        assert said.isprintable()


class TestOccupancy:
    def test_one_is_occupied_beside_minus_one(self):
        occupancy = WALLS.astype(np.int8)
        occupancy[0, 0] = -1
        assert maze_from_array(occupancy) == Maze(WALLS)

    def test_per_cent_are_thresholded_and_what_cannot_be_reached_is_closed(self, remarks):
        occupancy = np.full((5, 6), 100, dtype=np.int8)
        occupancy[1, 1:5] = [0, 25, -1, 0]  # the last is cut off by the unknown cell
        occupancy[2, 1:3] = [64, 65]  # unknown, occupied
        walls = np.ones((6, 6), dtype=bool)
        walls[1, 1:3] = False
        assert maze_from_array(occupancy, "map") == Maze(walls)
        assert "1 of 3 free cells (33 %) closed that can't be reached from the others" in remarks()[0]
        walls[1, 1:5] = walls[2, 1] = False
        assert maze_from_array(occupancy, unknown="free") == Maze(walls)

    @pytest.mark.parametrize(
        "form", [np.asarray, lambda walls: 100 * walls.astype(int), lambda w: np.where(w, "#", ".")]
    )
    def test_what_is_masked_is_unknown(self, form):
        mask = np.zeros_like(WALLS)
        distances = Maze(WALLS).distances(tuple(np.argwhere(~WALLS)[0]))
        mask[np.unravel_index(distances.argmax(), mask.shape)] = True  # a dead end, behind which nothing is cut off
        seen = np.ma.masked_array(form(WALLS), mask)
        for array in (seen, list(seen), tuple(seen)):
            assert (
                maze_from_array(array) == mazebench.Task.of(mazes=array, distances=[1]).mazes[0] == Maze(WALLS | mask)
            )
        assert maze_from_array(seen, unknown="free") == Maze(WALLS)


@pytest.mark.parametrize(
    "form", [np.asarray, lambda walls: 100 * walls.astype(int), lambda walls: np.where(walls, "#", ".")]
)
class TestAnyForm:
    """Walls, per cent and characters of one grid get the same lines."""

    def test_an_open_grid_is_closed_and_the_shift_said(self, form, remarks):
        walls = WALLS.copy()
        walls[1, 0] = walls[0, 1] = False
        np.testing.assert_array_equal(maze_from_array(form(walls), "m").walls[1:, 1:], walls)
        shift = "m: wall added along its border; its cell (r, c) is (r + 1, c + 1) in the maze; "
        assert remarks()[0].startswith(shift)

    def test_an_inverted_grid_is_asked_about(self, form):
        with pytest.raises(MazeError, match="is it inverted"):
            maze_from_array(form(~WALLS))


class TestFile:
    def test_the_array_of_an_archive_is_read(self, tmp_path):
        np.savez(tmp_path / "plan.npz", walls=WALLS)
        assert mazebench.read_maze(tmp_path / "plan.npz") == Maze(WALLS)
        np.savez(tmp_path / "plan.npz", walls=WALLS, other=WALLS)
        with pytest.raises(InputError, match=r"with one array, found 2: walls, other; save one as \.npy"):
            mazebench.read_maze(tmp_path / "plan.npz")

    @pytest.mark.parametrize("shape", [(3, 60_000), (120, 2**20), (9000, 9000)])
    def test_an_archive_takes_no_more_memory_than_a_maze_may(self, shape, tmp_path):
        np.savez_compressed(tmp_path / "plan.npz", np.zeros(shape, np.uint8))
        with pytest.raises(
            InputError, match=r"at most 1024 cells a side, found 3 x 60000|at most 33554432 bytes when unpacked"
        ):
            mazebench.read_maze(tmp_path / "plan.npz")

    def test_a_pickle_is_refused(self, tmp_path):
        np.save(tmp_path / "plan.npy", np.array([{}]), allow_pickle=True)
        with pytest.raises(InputError, match=r"plan\.npy: expected a \.npy file of numbers, found .*Object arrays"):
            mazebench.read_maze(tmp_path / "plan.npy")

    @pytest.mark.parametrize(
        ("content", "found"), [(b"", "an empty file"), (b"PK\3\4", "a ZIP archive"), (b"abc", "a file of another kind")]
    )
    def test_another_file_is_named(self, content, found, tmp_path):
        (tmp_path / "plan.npy").write_bytes(content)
        with pytest.raises(InputError, match=rf"plan\.npy: expected a \.npy file of numbers, found {found}"):
            mazebench.read_maze(tmp_path / "plan.npy")


class TestTasks:
    def test_an_array_is_a_task(self):
        env = mazebench.load(mazes=WALLS, distances=[2])
        assert env.maze_task.mazes == (Maze(WALLS),)

    def test_several_arrays_are_a_task(self):
        other = WALLS.T.copy()
        for maps in ([WALLS, other], (Maze(WALLS), other), np.stack([WALLS, other]), [WALLS.tolist(), other.tolist()]):
            assert mazebench.Task.of(mazes=maps, distances=[2]).mazes == (Maze(WALLS), Maze(other))

    @pytest.mark.parametrize(
        "form",
        [
            pd.DataFrame,
            lambda w: pd.DataFrame(w, dtype="boolean"),
            torch.tensor,
            list,
            np.ndarray.tolist,
            lambda w: tuple(map(tuple, w)),
        ],
    )
    def test_an_array_of_any_library_is_read_alike(self, form):
        assert maze_from_array(form(WALLS)) == Maze(WALLS)
        assert mazebench.Task.of(mazes=form(WALLS), distances=[2]).mazes == (Maze(WALLS),)

    @pytest.mark.parametrize(
        ("array", "message"),
        [
            (np.stack([WALLS] * 3, axis=-1), r"found shape \(7, 7, 3\) bool; of a picture, give one channel"),
            (WALLS[..., None], r"found shape \(7, 7, 1\) bool; of a picture"),
            ([[1, 1], [1]], "expected an array, found list"),
            ([None], r"found shape \(1,\) object"),
        ],
    )
    def test_what_is_no_maze_is_refused_alike(self, array, message):
        for read in (maze_from_array, lambda mazes: mazebench.Task.of(mazes=mazes)):
            with pytest.raises(InputError, match=message):
                read(array)

    @pytest.mark.parametrize("mazes", [5, ["plan.txt", "other.txt"]])
    def test_other_values_are_refused(self, mazes):
        with pytest.raises(InputError, match=r"expected .* in mazes|expected mazes as"):
            mazebench.Task.of(mazes=mazes)
