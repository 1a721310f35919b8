"""Maps of ROS: a YAML file and a picture, as `map_server` reads and `map_saver` writes them.

The rules are those of http://wiki.ros.org/map_server, and in details those of `nav2_map_server` since 1.4.0.
"""

from __future__ import annotations

import contextlib
import math
import os
import pathlib
import re
from typing import Annotated, Any, Literal

import cv2
import numpy as np
import pydantic
import scipy
import yaml
from annotated_types import Interval

from mazebench.errors import InputError, remark
from mazebench.maps.maze import Maze, MazeError
from mazebench.maps.readers.image import read_picture, to_gray
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, Pose
from mazebench.storage.files import open_whole
from mazebench.storage.yaml_files import load_yaml

ROS_SUFFIXES = (".yaml", ".yml")
_MASK_NAME = re.compile(
    r"keep[-_]?out|(^|[-_.])speed([-_.]?(mask|limit|zone|filter)|[-_.]|$)|[-_.]mask$"
)  # of Nav2's filters
_FREE_SHADE, _UNKNOWN_SHADE, _OCCUPIED_SHADE = 254, 205, 0  # that map_saver writes
_SAVED_SHADES = 3  # the commonest ones of a map that map_saver wrote, also if it was retouched since
_OCCUPIED_THRESH, _FREE_THRESH = 0.65, 0.196  # with which map_server reads them back
_LEAST_INSIDE = 0.2  # share of a floor plan that is free inside of closed outer walls; less of it is a closed room
_Share = Annotated[float, Interval(ge=0, le=1)]
# Of a floor plan with soft edges: the most pixels of one, the shades of what is certainly wall, and the least
# difference of shades across an edge's pixels, or between a thin line and what is around it.
_SOFT, _DARK, _CONTRAST = 6, 51, 16
_MOSTLY_DARK = 0.8  # share of walls from which a floor plan is light on dark; mazes of corridors have up to 0.6


class _Metadata(pydantic.BaseModel):
    """The content of the YAML file; other keys are ignored, as by map_server."""

    # Absolute, or beside the YAML file.
    image: str = pydantic.Field(pattern=r"^[^\x00]{1,1000}$", description="the name of a picture")
    resolution: float = pydantic.Field(ge=0.001, le=100, description="the side of a pixel, 0.001 to 100 m")
    # x, y (m) and yaw (rad) of the lower left corner of the picture
    origin: tuple[pydantic.FiniteFloat, pydantic.FiniteFloat, float] = pydantic.Field(
        description="three finite numbers, [x, y, yaw]"
    )
    negate: bool = pydantic.Field(description="0 or 1")  # whether light is occupied
    # A pixel whose probability of being occupied is at most the second is free, else at least the first wall.
    occupied_thresh: _Share = pydantic.Field(description="a number from 0 to 1")
    free_thresh: _Share = pydantic.Field(description="a number from 0 to occupied_thresh")
    mode: Literal["trinary", "scale", "raw"] = pydantic.Field("trinary", description="trinary, scale or raw")

    @pydantic.field_validator("free_thresh")
    @classmethod
    def _is_lower(cls, free_thresh: float, info: pydantic.ValidationInfo) -> float:
        if free_thresh > info.data.get("occupied_thresh", 1.0):
            raise ValueError
        return free_thresh


def read_floor_plan(path: pathlib.Path, pixel_size: float) -> OccupancyGrid:
    """Reads a picture of a floor plan as a map of ROS with pixels of `pixel_size` m and the usual thresholds.

    Marks in colour are floor. What lies outside of closed outer walls is unknown, and is cut off around the plan. The
    lower left corner of the picture is the origin of the map.

    Raises:
      InputError: if the file can't be read.
      MazeError: if there is no legal maze in it.
    """
    metadata = _Metadata(
        image=path.name,
        resolution=pixel_size,
        origin=(0, 0, 0),
        negate=False,
        occupied_thresh=_OCCUPIED_THRESH,
        free_thresh=_FREE_THRESH,
        mode="trinary",
    )
    gray = to_gray(read_picture(path), path.stem)
    states = _states(gray, metadata)
    shades = f"its shades are {gray.min()} to {gray.max()}"
    if not (states == OCCUPIED).any():
        raise MazeError(f"{path.stem}: expected dark walls on light paper, found none; {shades}")
    if (states == OCCUPIED).mean() > _MOSTLY_DARK:
        raise MazeError(
            f"{path.stem}: expected dark walls on light paper, found more dark than light; invert the picture"
        )

    # The part of the picture that the walls span, with the lower left corner of the picture as origin.
    # Soft edges are floor inside; outside, walls reach to the middle of them.
    edges = _soft_edges(states, gray)
    states = _without_surroundings(np.where(edges, FREE, states))
    states[edges & (states == UNKNOWN) & (gray < 128) & _near(states == OCCUPIED)] = OCCUPIED
    rows, columns = _box_of_walls(states)
    x, y = columns.start * pixel_size, (len(states) - rows.stop) * pixel_size
    return OccupancyGrid(states[rows, columns], pixel_size, (x, y, 0.0), shades=shades, frame=states.shape)


def _soft_edges(states: np.ndarray, gray: np.ndarray) -> np.ndarray:
    """Returns which pixels are shades between a dark wall and the floor beside it: `[H, W]` bool.

    They come of blur, scanning or enlarging. In a free corner of a maze they are up to three quarters dark. Areas of
    one shade are no edges, nor are thin lines, which are darker than what is around them.
    """
    is_dark, is_free, around = gray < _DARK, states == FREE, np.ones((3, 3))
    is_slope = cv2.morphologyEx(gray, cv2.MORPH_GRADIENT, around) >= _CONTRAST
    is_line = cv2.morphologyEx(gray, cv2.MORPH_BLACKHAT, around) >= _CONTRAST
    return ~is_dark & ~is_free & is_slope & ~is_line & _near(is_dark) & _near(is_free)


def _near(pixels: np.ndarray) -> np.ndarray:
    """Returns which pixels are as near to some of `pixels` as a soft edge is wide."""
    return cv2.dilate(pixels.astype(np.uint8), np.ones((2 * _SOFT + 1,) * 2)) > 0


def _box_of_walls(states: np.ndarray) -> tuple[slice, slice]:
    """Returns the rows and the columns from the first to the last with a wall; there is one."""
    (box,) = scipy.ndimage.find_objects((states == OCCUPIED).astype(int))
    return box


def _without_surroundings(states: np.ndarray) -> np.ndarray:
    """Returns states in which all that lies outside of the outer walls is unknown; as they are if these are open."""
    light, _ = scipy.ndimage.label(np.pad(states != OCCUPIED, 1, constant_values=True))
    inside = np.where(light[1:-1, 1:-1] == light[0, 0], UNKNOWN, states)
    free = inside == FREE
    if free.sum() < _LEAST_INSIDE * states[_box_of_walls(states)].size:
        return states
    # Specks and frames on the paper are dark, too; the walls are what touches an area with free pixels.
    dark, _ = scipy.ndimage.label(states == OCCUPIED, structure=np.ones((3, 3)))
    floor = np.isin(light[1:-1, 1:-1], np.unique(light[1:-1, 1:-1][free]))
    walls = np.isin(dark, dark[scipy.ndimage.binary_dilation(floor, np.ones((3, 3))) & (dark > 0)])
    return np.where((dark > 0) & ~walls, UNKNOWN, inside)


def read_occupancy(path: pathlib.Path) -> OccupancyGrid:
    """Reads what map_server would publish of a map, with all that is between free and occupied as unknown.

    It departs from map_server in one case. In the mode trinary, map_saver writes the shade 205 for unknown, but many of
    its versions write a `free_thresh` with which map_server takes 205 as free. In a picture in which 205 is one of the
    three commonest shades, it is therefore unknown whatever the threshold says.

    Raises:
      InputError: if one of the two files can't be read.
    """
    metadata = _read_metadata(path)
    if is_filter_mask(path):
        remark(f"{path}: read as a building, though by its name it is a mask of a costmap filter, as Nav2 has them")
    image = picture_of(path)
    try:
        picture = read_picture(image)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    states = _states(picture, metadata)

    named = path.parent / os.path.expanduser(metadata.image.removeprefix("file://"))
    changes = [] if named == image else [f"image {metadata.image} taken from {image.parent}"]
    is_departure = metadata.mode == "trinary" and _state_of_shades(metadata)[_UNKNOWN_SHADE] == FREE
    if is_departure and (is_unknown := _saved_as_unknown(picture)).any():
        states[is_unknown] = UNKNOWN
        changes.append(
            f"shade {_UNKNOWN_SHADE} read as unknown, as map_saver means it, though free_thresh "
            f"{metadata.free_thresh:g} says free"
        )
    x, y, yaw = metadata.origin
    if not math.isfinite(yaw):  # some versions of map_saver wrote nan
        changes.append(f"yaw {yaw:g} read as 0")
        yaw = 0.0
    shades = f"its shades are {picture.min()} to {picture.max()}"
    return OccupancyGrid(states, metadata.resolution, (x, y, yaw), tuple(changes), shades, frame="map")


def is_map(path: pathlib.Path) -> bool:
    """Returns whether a YAML file names a picture, as a map does; one that can't be read may be a map."""
    try:
        content = load_yaml(path, "ROS map")
    except InputError:
        return True
    return isinstance(content, dict) and "image" in content


def is_filter_mask(path: pathlib.Path) -> bool:
    """Returns whether a YAML file is, by its name, a mask of keepout zones or speed limits beside a map."""
    return _MASK_NAME.search(path.stem.lower()) is not None


def picture_of(path: pathlib.Path) -> pathlib.Path:
    """Returns the path of the picture that a YAML file names, or of one of that name beside it if there is none.

    Raises:
      InputError: if the file can't be read.
    """
    name = _read_metadata(path).image
    named = path.parent / os.path.expanduser(name.removeprefix("file://"))
    beside = path.parent / re.split(r"[/\\]", name)[-1]
    return beside if beside.is_file() and not named.is_file() else named


def map_of_picture(path: pathlib.Path) -> pathlib.Path | None:
    """Returns the YAML file of the same name that names a picture; None if there is none."""
    for suffix in ROS_SUFFIXES:
        with contextlib.suppress(InputError):  # of another YAML file, or none
            if picture_of(path.with_suffix(suffix)).resolve() == path.resolve():
                return path.with_suffix(suffix)
    return None


def write_ros_map(maze: Maze, path: str | pathlib.Path, origin: Pose = (0.0, 0.0, 0.0)) -> None:
    """Writes `maze` as a map of ROS, with a picture of a pixel for each cell beside the YAML file at `path`.

    A pixel's side is the size of a cell. `origin` is x, y (m) and yaw (rad) of the maze's lower left corner in the
    map's frame, as `mazebench.maps.maze_files.read_located` returns it; if it is not given, that frame is the maze's.
    """
    path = pathlib.Path(path)
    picture = path.with_suffix(".pgm")
    shades = np.where(maze.walls, _OCCUPIED_SHADE, _FREE_SHADE).astype(np.uint8)
    metadata = {
        "image": picture.name,
        "mode": "trinary",
        "resolution": float(maze.cell_size),
        "origin": [round(number, 9) for number in origin],
        "negate": 0,
        "occupied_thresh": _OCCUPIED_THRESH,
        "free_thresh": _FREE_THRESH,
    }
    with open_whole(picture) as file:
        file.write(cv2.imencode(".pgm", shades)[1].tobytes())
    with open_whole(path) as file:
        yaml.safe_dump(metadata, file, encoding="utf-8", allow_unicode=True, sort_keys=False, default_flow_style=None)


def _read_metadata(path: pathlib.Path) -> _Metadata:
    content, expected = load_yaml(path, "ROS map"), f"{path}: expected the YAML file of a ROS map"
    if not isinstance(content, dict):
        found = "an empty file" if content is None else f"no keys but {_shown(content)}"
        raise InputError(f"{expected}, with keys such as image and resolution, found {found}")
    try:
        return _Metadata.model_validate(content)
    except pydantic.ValidationError as error:
        key = str(error.errors()[0]["loc"][0])
        found = _shown(content[key]) if key in content else f"only {', '.join(map(str, content))}"[:120]
        meaning = _Metadata.model_fields[key].description
        raise InputError(f"{expected}, with {key} ({meaning}), found {found}") from error


def _shown(value: Any) -> str:
    try:
        return repr(value)[:60]
    except ValueError:  # Python writes no numbers of thousands of digits
        return "a number of too many digits"


def _states(picture: np.ndarray, metadata: _Metadata) -> np.ndarray:
    """Returns `[H, W]` int8 of a picture: `[H, W]`, or `[H, W, 3]` or `[H, W, 4]` with opacity, uint8 or uint16."""
    if picture.dtype == np.uint16:
        picture = (picture >> 8).astype(np.uint8)
    colors = np.ascontiguousarray(picture[..., :3])
    states = _state_of_shades(metadata)[picture if picture.ndim == 2 else cv2.cvtColor(colors, cv2.COLOR_RGB2GRAY)]
    if metadata.mode != "raw" and picture.shape[2:] == (4,):
        states[picture[..., 3] < 255] = UNKNOWN
    return states


def _saved_as_unknown(picture: np.ndarray) -> np.ndarray:
    """Returns `[H, W]` bool: the pixels of the shade of unknown, if it is one of the commonest; else none."""
    colors = picture[..., :3] if picture.ndim == 3 else picture[..., None]
    shades = colors[..., 0]
    is_gray = (colors == shades[..., None]).all(axis=-1)
    counts = np.bincount(shades[is_gray], minlength=_UNKNOWN_SHADE + 1)
    is_common = counts[_UNKNOWN_SHADE] >= np.sort(counts)[-_SAVED_SHADES]
    return is_gray & (shades == _UNKNOWN_SHADE) & is_common


def _state_of_shades(metadata: _Metadata) -> np.ndarray:
    """Returns the states, `[256]` int8, of shades from 0 (black) to 255 (white)."""
    shades = np.arange(256)
    occupied = (shades if metadata.negate else 255 - shades) / 255
    if metadata.mode == "raw":  # the picture holds percentages; above 100 is unknown
        occupied = np.where(shades <= OCCUPIED, shades / OCCUPIED, np.nan)
    states = np.full(len(shades), UNKNOWN, dtype=np.int8)
    states[occupied >= metadata.occupied_thresh] = OCCUPIED
    states[occupied <= metadata.free_thresh] = FREE
    if metadata.mode == "scale" and metadata.free_thresh < metadata.occupied_thresh:  # per cent, rounded
        scaled = np.round(100 * (occupied - metadata.free_thresh) / (metadata.occupied_thresh - metadata.free_thresh))
        states[scaled <= 0] = FREE
        states[scaled >= OCCUPIED] = OCCUPIED
    return states
