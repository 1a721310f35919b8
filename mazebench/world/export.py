"""A maze for other tools: a standalone MJCF file, and the walls as one watertight mesh."""

from __future__ import annotations

import pathlib

import numpy as np
import trimesh

from mazebench.maps.maze import WALL_HEIGHT, Maze
from mazebench.storage.files import open_whole
from mazebench.world.mjcf import maze_spec, wall_boxes
from mazebench.world.textures import add_textures

MESH_FORMATS = ("glb", "obj", "stl")

_WALL_COLOUR = (92, 120, 153, 255)
# Metres; the side of the pillars that join walls which touch only at a corner. Without pillars an edge would have four
# faces, and readers that merge vertices (OBJ, STL) would not find the mesh watertight.
_PILLAR = 0.02
# Metres by which pillars stand out above and below. Flush ones would leave the walls' corners in the mesh.
_PILLAR_OVERHANG = 0.001
# glTF has y up, we have z up.
_TO_GLTF = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def write_mjcf(maze: Maze, path: pathlib.Path, textures: bool = False, for_robot: bool = False) -> None:
    """Writes a model that MuJoCo opens without any other file; with `textures`, or to put a robot into.

    Raises:
      OSError: if it can't be written.
    """
    spec = maze_spec(maze, for_robot)
    if textures:
        add_textures(spec, maze)
    spec.compile()
    with open_whole(path) as file:
        file.write(spec.to_xml().encode("utf-8"))


def wall_mesh(maze: Maze) -> trimesh.Trimesh:
    """Returns the walls as one watertight mesh in metres, x to the right, y up the map, z up.

    A pillar of 2 cm joins walls that touch only at a corner, where no body can pass anyway.
    """
    boxes = [trimesh.creation.box(bounds=[at - half, at + half]) for at, half in zip(*wall_boxes(maze), strict=True)]

    # The points where two walls touch only at a corner, each with a pillar.
    walls = maze.walls
    top_left, top_right, bottom_left, bottom_right = walls[:-1, :-1], walls[:-1, 1:], walls[1:, :-1], walls[1:, 1:]
    touching = (top_left == bottom_right) & (top_right == bottom_left) & (top_left != top_right)
    for row, column in np.argwhere(touching):
        x, y = maze.cell_size * (column + 1), maze.cell_size * (maze.size - 1 - row)
        low = [x - _PILLAR / 2, y - _PILLAR / 2, -_PILLAR_OVERHANG]
        high = [x + _PILLAR / 2, y + _PILLAR / 2, WALL_HEIGHT + _PILLAR_OVERHANG]
        boxes.append(trimesh.creation.box(bounds=[low, high]))
    mesh = trimesh.boolean.union(boxes, engine="manifold", check_volume=False)
    mesh.visual.face_colors = _WALL_COLOUR
    return mesh


def write_mesh(maze: Maze, path: pathlib.Path) -> None:
    """Writes the wall mesh as GLB (y up, as in glTF), OBJ or STL (z up), by the suffix of `path`.

    Raises:
      OSError: if it can't be written.
    """
    mesh = wall_mesh(maze)
    if path.suffix == ".glb":
        mesh.apply_transform(_TO_GLTF)
    with open_whole(path) as file:
        content = mesh.export(file_type=path.suffix[1:])  # text of OBJ, bytes of the others
        file.write(content.encode("utf-8") if isinstance(content, str) else bytes(content))
