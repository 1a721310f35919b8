"""The arena of a task: its mazes and the older maps that are shown of them, read and checked once."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mazebench.errors import InputError, remark
from mazebench.maps.benchmark import KINDS_SIZE, SIZES, load_kind_mazes, load_mazes
from mazebench.maps.drawn import FreshMazes, Mazes, draw_mazes
from mazebench.maps.maze import MIN_CELL_SIZE, Cell, Maze, corner_cells, require_one_size
from mazebench.maps.maze_options import THIN_WALLS
from mazebench.maps.moving_doors import ChangingMazes, StandingMazes
from mazebench.maps.older_map import OlderMap
from mazebench.maps.places import free_cell_of_place
from mazebench.maps.real_buildings import is_real, load_building, load_older
from mazebench.maps.selection import maps_in_texts
from mazebench.tasks.context import MAX_CONTEXT_SIZE
from mazebench.tasks.perturbations.perturbation import Of, Perturbation
from mazebench.tasks.task_options import DRAWN_KINDS, ENDS, NUM_DRAWN, TaskOptions
from mazebench.tasks.tracks import LEVELS, MAX_CELL_SIZE, TRACKS, cells_of, distance_of

NUM_CHANGED = 4  # buildings in which things have changed since a plan of one's own was drawn

_DEFAULTS = TaskOptions()
_NUM_CHECKED = 10  # of fresh mazes, one of which must have the distances


@dataclasses.dataclass(frozen=True, eq=False)
class Arena:
    """The mazes that a task is played in, what is shown of them, and the ends of its episodes.

    `arena_of` makes one that is checked. Tasks that differ in other things share it.
    """

    mazes: Mazes
    shown: tuple[OlderMap, ...] | None = None  # older maps, instead of the mazes' own
    start: str | None = None  # of all episodes, as the option says; None if each draws one
    goal: str | None = None
    has_corners: bool = False  # whether episodes lead from corner to corner where no start or goal is given
    moves_doors: bool = False  # whether doors close and open while one drives
    # What was found: the farthest goals by maze, and the tracks and levels that all mazes can carry.
    _farthest: dict[int, int] = dataclasses.field(default_factory=dict, init=False, repr=False)
    _carried: set[tuple[str, int]] = dataclasses.field(default_factory=set, init=False, repr=False)

    @functools.cached_property
    def standing(self) -> StandingMazes:
        """The mazes by the numbers that say what stands; behind the mazes, those in which doors are closed."""
        return ChangingMazes(self.mazes) if self.moves_doors else self.mazes

    @property
    def size(self) -> int:
        """N, cells a side of all mazes."""
        return self.mazes[0].size

    @property
    def cell_size(self) -> float:
        """The width of the cells of all mazes in metres."""
        return self.mazes[0].cell_size

    def has(self, number: int) -> bool:
        """Returns whether a maze has the number, one of those that can stand."""
        return self.moves_doors or number < len(self.mazes)

    @property
    def fixed_mazes(self) -> tuple[Maze, ...]:
        """The mazes.

        Raises:
          InputError: if every episode has a new one.
        """
        if isinstance(self.mazes, FreshMazes):
            raise InputError("expected a task with a number of mazes, found fresh ones")
        return self.mazes

    def joined(self, maze: int) -> np.ndarray | None:
        """Returns `[N, N]` bool: the cells in maze number `maze` that may be start or goal; None for all free ones."""
        return None if self.shown is None else self.shown[maze].joined

    def ends(self, maze: int) -> tuple[Cell | None, Cell | None]:
        """Returns the start and the goal of all episodes in maze number `maze`; None for one that each episode draws.

        Raises:
          InputError: if one is not free, or not joined with the rest of an older map that is shown.
        """
        if not (self.start or self.goal or self.has_corners):
            return None, None
        given = {name: place for name in ENDS if (place := getattr(self, name)) is not None}
        cells = {name: free_cell_of_place(name, place, self.mazes[maze]) for name, place in given.items()}
        joined = self.joined(maze)
        for name, cell in cells.items():
            if joined is not None and not joined[cell]:
                raise InputError(
                    f"{name} {given[name]!r}: expected a cell that is free on the older map, too, found none"
                )
        corners = {}
        if self.has_corners:
            allowed = None if joined is None else np.argwhere(joined)
            corners = dict(zip(ENDS, corner_cells(self.mazes[maze], allowed), strict=True))
        start, goal = ((corners | cells).get(name) for name in ENDS)
        return start, goal

    def farthest(self, maze: int) -> int:
        """Returns the largest distance in cells that start and goal can have in maze number `maze`."""
        if maze not in self._farthest:
            self._farthest[maze] = _find_farthest(self.mazes[maze], self.joined(maze), *self.ends(maze))
        return self._farthest[maze]

    @functools.cached_property
    def _reached(self) -> tuple[int, ...]:
        """For each maze, a distance that it has for sure; most are found large enough without the distances of all."""
        if self.shown is not None or self.start or self.goal:
            return (0,) * len(self.mazes)
        return tuple(int(maze.distances(tuple(maze.free_cells[0])).max()) for maze in self.fixed_mazes)

    def require_levels(self, track: str, levels: Sequence[int]) -> None:
        """Raises `InputError` if a track can't be played in a maze at some levels; fresh ones are tried when drawn."""
        new = [level for level in levels if (track, level) not in self._carried]
        if not new or self.shown is not None or isinstance(self.mazes, FreshMazes):
            return
        for maze in self.mazes:
            TRACKS[track].require(maze, new)
        self._carried.update((track, level) for level in new)

    def require_distances(self, distances: Sequence[int], track: str | None) -> None:
        """Raises `InputError` if no goal is as far away in a maze as wanted: in cells, on a track in metres."""
        if self.has_corners or (self.start and self.goal):
            return
        longest, unit = cells_of(max(distances), self.cell_size, track), "cells" if track is None else "m"
        if isinstance(self.mazes, FreshMazes):  # an episode whose maze is too small takes another one
            numbers = [max(range(_NUM_CHECKED), key=self.farthest)]
        else:
            numbers = [number for number, reached in enumerate(self._reached) if longest > reached]
        for number in numbers:
            if longest > (farthest := self.farthest(number)):
                raise InputError(
                    f"{self.mazes[number].name}: expected distances of at most "
                    f"{distance_of(farthest, self.cell_size, track)} {unit}, as far as the maze reaches, "
                    f"found {max(distances)}; choose others (--distances)"
                )


def _find_farthest(maze: Maze, joined: np.ndarray | None, start: Cell | None, goal: Cell | None) -> int:
    if start is not None and goal is not None:
        return maze.distance(start, goal)
    given = start or goal
    if joined is None or joined.sum() == len(maze.free_cells):
        return maze.diameter if given is None else int(maze.distances(given).max())

    # Among the cells that are joined on the older map; a lower bound by a double sweep if no end is given.
    cells = np.argwhere(joined)
    if not len(cells):
        return 0
    if given is None:
        near = maze.distances(tuple(cells[0]))[joined]
        given = tuple(cells[near.argmax()])
    return int(maze.distances(given)[joined].max())


def arena_of(asked: TaskOptions, mazes: Mazes | None = None, shown: tuple[OlderMap, ...] | None = None) -> Arena:
    """Returns the arena of options, checked.

    Args:
      asked: the options; what is open is filled by default.
      mazes: those that are there already; by default those that the options name are read or drawn.
      shown: older maps of `mazes`.

    Raises:
      InputError: if a map can't be read, mazes are not of one size and scale, or the task can't be played in one.
    """
    if mazes is None and not (asked.has_own or asked.is_drawn):
        return _arena_of_benchmark(asked.task, asked.size, asked.split)
    if mazes is None:
        mazes, shown = _read(asked)
    if isinstance(mazes, FreshMazes):
        for name in ENDS:
            if (end := getattr(asked, name)) is not None:
                raise InputError(f"fresh mazes: expected no {name}, which may be a wall in one of them, found {end!r}")
        return _unchecked(asked, mazes)
    require_one_size(mazes)
    for number, maze in enumerate(mazes):
        _check_maze(asked, maze, None if shown is None else shown[number])
    return _unchecked(asked, mazes, shown)


@functools.lru_cache(maxsize=16)
def _arena_of_benchmark(task: str, size: int | None, split: str | None) -> Arena:
    asked = _DEFAULTS.filled(task=task, size=size, split=split)
    return arena_of(asked, *_read(asked))


def pixels_of_track(track: str, size: int) -> int:
    """Returns M, the pixels a side of the maps that a track shows of mazes of `size` cells a side.

    Raises:
      InputError: if they are too many.
    """
    pixels = TRACKS[track].pixels_per_cell
    if pixels * size > MAX_CONTEXT_SIZE:
        raise InputError(
            f"track {track!r}: expected mazes of at most {MAX_CONTEXT_SIZE // pixels} cells a side, "
            f"whose maps have at most {MAX_CONTEXT_SIZE} pixels, found {size}; crop the map, or give a larger "
            f"cell_size, up to {MAX_CELL_SIZE:g} m"
        )
    return pixels * size


def _unchecked(asked: TaskOptions, mazes: Mazes, shown: tuple[OlderMap, ...] | None = None) -> Arena:
    moves_doors = asked.track is not None and TRACKS[asked.track].moves_doors
    return Arena(mazes, shown, asked.start, asked.goal, asked.is_hierarchical, moves_doors)


def _read(asked: TaskOptions) -> tuple[Mazes, tuple[OlderMap, ...] | None]:
    """Returns the mazes, loaded or drawn, with their older maps."""
    size = asked.size or (SIZES[0] if asked.track is None else KINDS_SIZE)
    if asked.fresh:
        return FreshMazes(asked.kinds or DRAWN_KINDS[:1], size), None
    if asked.is_drawn:
        split = "train" if asked.split in (None, "train") else "dev"
        return draw_mazes(asked.kinds or DRAWN_KINDS[:1], size, split, asked.num_mazes or NUM_DRAWN), None
    if asked.mazes is None:
        split = asked.split or "train"
        return load_mazes(size, split) if asked.track is None else load_kind_mazes(split), None
    mazes, shown = _read_own(asked)
    for maze in mazes:
        if asked.size not in (None, maze.size):
            raise InputError(f"expected mazes of size {asked.size}, found size {maze.size}")
    if shown is None and asked.track is not None:
        return _with_changes(asked, mazes)
    return mazes, shown


def _read_own(asked: TaskOptions) -> tuple[tuple[Maze, ...], tuple[OlderMap, ...] | None]:
    """Returns the mazes of one's own in which the task can be played, with their older maps."""
    mazes, shown = asked.mazes, None
    if not isinstance(mazes, str):
        return mazes, None if asked.shown is None else maps_in_texts(asked.shown, mazes)
    if is_real(mazes):
        _check_maze(asked, maze := load_building(mazes))
        return (maze,), None if asked.shown is None else (load_older(asked.shown, mazes),)
    from mazebench.maps.maze_files import read_mazes, read_with_older  # with all readers, which few commands need

    radius = asked.driven_body.radius
    if asked.shown is None:
        mazes = read_mazes(mazes, asked.size, radius=radius, **dataclasses.asdict(asked.reading))
    else:
        mazes, shown = read_with_older(mazes, asked.shown, asked.reading, asked.align, radius)
    kept = _playable(mazes, functools.partial(_check_maze, asked))
    return tuple(mazes[each] for each in kept), shown and tuple(shown[each] for each in kept)


def _with_changes(asked: TaskOptions, plans: tuple[Maze, ...]) -> tuple[tuple[Maze, ...], tuple[OlderMap, ...] | None]:
    """Returns the true buildings of mazes of one's own, their plans, if buildings differ from maps on the track.

    Raises:
      InputError: if none of the plans can be changed so, or levels differ in it.
    """
    track = asked.task
    changes = {TRACKS[track].levels[level - 1].of(Of.BUILDING) for level in asked.level or LEVELS[:1]}
    if len(changes) > 1:
        found = ", ".join(map(str, asked.level or ()))
        raise InputError(
            f"track {track!r}: expected one level in mazes of your own, whose changes depend on it, found {found}"
        )
    [perturbations] = changes
    if not perturbations:
        return plans, None

    shown: list[OlderMap] = []

    def change(plan: Maze) -> None:
        _check_maze(asked, plan)
        shown.extend(OlderMap(plan.walls, maze) for maze in _buildings(plan, plan.name, plan.kind, perturbations))

    pixels_of_track(track, plans[0].size)  # what takes a moment is checked first
    _playable(plans, change)
    return tuple(each.maze for each in shown), tuple(shown)


@functools.lru_cache(maxsize=32)
def _buildings(plan: Maze, name: str, kind: str, perturbations: tuple[Perturbation, ...]) -> tuple[Maze, ...]:
    """Returns the true buildings of a plan; name and kind are its own, for plans of equal walls are equal."""
    buildings = [plan] * NUM_CHANGED
    for place, perturbation in enumerate(perturbations):
        rngs = (np.random.default_rng([place, number]) for number in range(NUM_CHANGED))
        buildings = [perturbation.building(*each) for each in zip(buildings, rngs, strict=True)]
    return tuple(
        dataclasses.replace(building, name=f"{name}-changed-{number}") for number, building in enumerate(buildings, 1)
    )


def _check_maze(asked: TaskOptions, maze: Maze, older: OlderMap | None = None) -> None:
    """Raises `InputError` if the task can't be played in a maze."""
    if maze.cell_size < MIN_CELL_SIZE:
        raise InputError(
            f"{maze.name}: expected cells of at least {MIN_CELL_SIZE} m, through which the body passes, "
            f"found {maze.cell_size} m; {THIN_WALLS}"
        )
    if asked.track is not None and maze.cell_size > MAX_CELL_SIZE:
        widest = MAX_CONTEXT_SIZE // TRACKS[asked.track].pixels_per_cell * MAX_CELL_SIZE
        remedy = f"crop the map to {widest:g} m a side" if maze.side > widest else "give a smaller cell_size"
        raise InputError(
            f"track {asked.track!r}: expected cells of at most {MAX_CELL_SIZE:g} m, "
            f"found {maze.cell_size:g} m; {remedy}"
        )
    if len(maze.free_cells) < 2:
        raise InputError(f"{maze.name}: expected two free cells for a start and a goal, found one")
    start, goal = _unchecked(asked, (maze,), None if older is None else (older,)).ends(0)
    if start is not None and start == goal:
        raise InputError(f"{maze.name}: expected start and goal in different cells, found both in {start}")


def _playable(mazes: Sequence[Maze], check: Callable[[Maze], Any]) -> list[int]:
    """Returns the numbers of the mazes that `check` lets pass, and warns of each other one.

    Raises:
      InputError: if it is none.
    """
    faults: dict[int, InputError] = {}
    for number, maze in enumerate(mazes):
        try:
            check(maze)
        except InputError as error:
            faults[number] = error
    if len(faults) == len(mazes):
        raise faults[0]
    for number, fault in faults.items():
        remark(f"maze {mazes[number].name!r} left out: {fault}")
    return [number for number in range(len(mazes)) if number not in faults]
