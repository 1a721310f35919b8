"""The frozen real buildings: mazes made of maps of real and simulated buildings, with their older maps.

The value `real:NAME` of the option `mazes` names one of them. `N` is the number of cells on a side of a maze.
"""

from __future__ import annotations

import csv
import functools
from typing import NamedTuple

import cv2
import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.benchmark import REAL_BENCHMARK, read_asset, read_asset_bytes
from mazebench.maps.maze import Maze
from mazebench.maps.older_map import OlderMap

PREFIX = "real:"
TABLE = "buildings.csv"
RIGHT, YEARS = "right", "years"
# How a map came about: scanned by a robot in a building, drawn by people, of a simulated world, or not known.
ORIGINS = SCAN, PLAN, SIMULATION, UNCLEAR = "scan", "plan", "simulation", "unclear"


class Building(NamedTuple):
    """A row of the table of frozen buildings."""

    name: str
    split: str  # "dev" or "eval", the same for all buildings of a site
    setting: str  # "right"; "changed-1" or "changed-2", by the strength; or "years"
    site: str  # where it stands, as campuses and worlds are named
    use: str  # such as "office"
    origin: str  # one of `ORIGINS`
    cell_size: str  # m
    older: str  # the name of the older map that is shown in the settings "changed" and "years"; else empty
    source: str  # the map that it was made of, a name in sources.csv


@functools.cache
def buildings() -> dict[str, Building]:
    """Returns the frozen buildings by their names."""
    rows = csv.DictReader(read_asset(TABLE, REAL_BENCHMARK).splitlines())
    return {row["name"]: Building(**row) for row in rows}


def is_real(mazes: object) -> bool:
    """Returns whether a value of the option `mazes` or `shown` names a frozen building, or all of a setting."""
    return isinstance(mazes, str) and mazes.startswith(PREFIX)


def building_of(mazes: str) -> Building:
    """Returns the building that a value of the option `mazes` names.

    Raises:
      InputError: if there is no such building.
    """
    name = mazes.removeprefix(PREFIX)
    if name not in buildings():
        raise unknown("real building", name, buildings())
    return buildings()[name]


def is_setting(mazes: str) -> bool:
    """Returns whether a value of the option `mazes` names all buildings of a setting, as reports group them."""
    return mazes.removeprefix(PREFIX) in {building.setting for building in buildings().values()}


@functools.lru_cache(maxsize=16)
def load_building(mazes: str) -> Maze:
    """Returns the maze that a value of the option `mazes` names; its kind is its origin.

    Raises:
      InputError: if there is no such building.
    """
    building = building_of(mazes)
    return Maze(_read_walls(building.name), building.name, float(building.cell_size), building.origin)


def load_older(shown: str, mazes: str) -> OlderMap:
    """Returns the older map of a building that a value of the option `shown` names: its own one, or the maze itself.

    Raises:
      InputError: if it names another one.
    """
    building, maze = building_of(mazes), load_building(mazes)
    maps = [PREFIX + name for name in (building.older, building.name) if name]
    if shown not in maps:
        raise InputError(f"shown beside {mazes}: expected {' or '.join(maps)}, found {shown}")
    return OlderMap(_read_walls(shown.removeprefix(PREFIX)), maze)


def _read_walls(name: str) -> np.ndarray:
    """Returns `[N, N]` bool of a picture with a pixel for each cell, where black is wall."""
    content = read_asset_bytes(f"{name}.png", REAL_BENCHMARK)
    walls = np.asarray(cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)) == 0
    walls.flags.writeable = False
    return walls
