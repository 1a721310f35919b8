"""The textured look of a maze: walls, floor and sky that tell places apart, by MuJoCo's own textures alone.

The walls seen from a region have one of a few surfaces, which is drawn from a hash of the walls. So equal mazes look
equal, and in a maze that was never seen a surface says nothing about the place on the map.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import mujoco
import numpy as np

from mazebench.maps.maze import WALL_HEIGHT, Maze
from mazebench.world.looks import regions_of, rng_of

_OFFSET = 0.002  # m, from a wall to its face

_Colour = tuple[float, float, float]


class _Surface(NamedTuple):
    """A texture for walls, told apart from the others, from the red goal and from the orange body."""

    builtin: mujoco.mjtBuiltin
    colours: tuple[_Colour, _Colour]
    mark: mujoco.mjtMark
    mark_colour: _Colour
    pixels: tuple[int, int]  # width and height of the texture; marks are one pixel wide
    span: tuple[float, float]  # m, along the wall and upwards, that the texture covers


def _tiles(colour: _Colour, lines: _Colour, pixels: tuple[int, int], span: tuple[float, float]) -> _Surface:
    return _Surface(mujoco.mjtBuiltin.mjBUILTIN_FLAT, (colour, colour), mujoco.mjtMark.mjMARK_EDGE, lines, pixels, span)


def _checks(one: _Colour, other: _Colour, span: tuple[float, float]) -> _Surface:
    return _Surface(mujoco.mjtBuiltin.mjBUILTIN_CHECKER, (one, other), mujoco.mjtMark.mjMARK_NONE, one, (64, 64), span)


def _dots(colour: _Colour, dots: _Colour) -> _Surface:
    mark = mujoco.mjtMark.mjMARK_RANDOM
    return _Surface(mujoco.mjtBuiltin.mjBUILTIN_FLAT, (colour, colour), mark, dots, (16, 16), (1, 1))


_WHITE, _DARK = (0.95, 0.95, 0.95), (0.16, 0.17, 0.22)
_SURFACES = (
    _tiles((0.20, 0.42, 0.85), _WHITE, (24, 24), (0.5, 0.5)),
    _checks((0.20, 0.55, 0.25), (0.62, 0.85, 0.50), (1, 1)),
    _tiles((0.95, 0.80, 0.22), _DARK, (64, 16), (1, 0.25)),
    _dots((0.50, 0.30, 0.72), (0.88, 0.80, 0.98)),
    _checks((0.08, 0.60, 0.62), _WHITE, (0.5, 0.5)),
    _tiles(_WHITE, (0.35, 0.36, 0.40), (32, 16), (0.5, 0.25)),
    _dots(_DARK, (0.98, 0.86, 0.30)),
    _tiles((0.56, 0.38, 0.22), (0.24, 0.15, 0.08), (16, 64), (0.25, 1)),
    _checks((0.13, 0.20, 0.50), (0.45, 0.68, 0.95), (1, 0.5)),
    _tiles((0.42, 0.44, 0.50), _DARK, (12, 12), (1, 1)),
    _checks(_DARK, _WHITE, (0.5, 1)),
    _tiles((0.55, 0.78, 0.20), (0.13, 0.30, 0.08), (16, 64), (0.25, 1)),
)


class Face(NamedTuple):
    """A part of a wall's side, as high as the wall, that is seen from one region."""

    x: float  # m, its middle
    y: float
    yaw: float  # rad, from +y to where it faces
    half_length: float  # m
    surface: int  # index among the surfaces


def wall_faces(maze: Maze) -> list[Face]:
    """Returns the sides of walls that border free cells, in pieces as long as one surface reaches."""
    faces = []
    surfaces = _surfaces(maze)
    scale, middle = maze.cell_size, maze.size / 2
    for turns in range(4):
        turned = np.rot90(surfaces, turns)
        # Free cells with a wall below; the outer walls are the last row.
        seen = np.where(turned[1:] < 0, turned[:-1], -1)
        for row, line in enumerate(seen):
            ends = (np.flatnonzero(np.diff(line)) + 1).tolist()
            for begin, end in itertools.pairwise([0, *ends, len(line)]):
                if line[begin] < 0:
                    continue
                # The middle of the face, from the middle of the maze; turned back, clockwise.
                x, y = scale * ((begin + end) / 2 - middle), scale * (middle - row - 1) + _OFFSET
                for _ in range(turns):
                    x, y = y, -x
                face = Face(
                    x=x + scale * middle,
                    y=y + scale * middle,
                    yaw=-turns * np.pi / 2,
                    half_length=scale * (end - begin) / 2,
                    surface=int(line[begin]),
                )
                faces.append(face)
    return faces


def _surfaces(maze: Maze) -> np.ndarray:
    """Returns the surface of the walls that are seen from each free cell, -1 in walls: `[N, N]` int."""
    return np.where(maze.walls, -1, regions_of(maze, len(_SURFACES), rng_of(maze)))


def add_textures(spec: mujoco.MjSpec, maze: Maze) -> None:
    """Gives `spec`, the whole model of `maze`, the textured look: faces that are only seen, before the walls."""
    _add_materials(spec)
    for index, face in enumerate(wall_faces(maze)):
        # A plane faces its own z axis. This one is turned so that its y axis points up, then about the vertical.
        cos, sin = np.cos((face.yaw + np.pi) / 2), np.sin((face.yaw + np.pi) / 2)
        spec.worldbody.add_geom(
            name=f"face_{index}",
            type=mujoco.mjtGeom.mjGEOM_PLANE,
            pos=[face.x, face.y, WALL_HEIGHT / 2],
            quat=np.array([cos, cos, sin, sin]) * np.sqrt(0.5),
            size=[face.half_length, WALL_HEIGHT / 2, 1],
            material=f"face_{face.surface}",
            contype=0,
            conaffinity=0,
        )


def _add_materials(spec: mujoco.MjSpec) -> None:
    sky = spec.texture("sky")
    sky.rgb1, sky.rgb2 = (0.28, 0.50, 0.82), (0.90, 0.95, 0.99)
    floor = spec.texture("cells")
    floor.builtin = mujoco.mjtBuiltin.mjBUILTIN_CHECKER
    floor.rgb1, floor.rgb2 = (0.86, 0.83, 0.78), (0.80, 0.77, 0.71)

    textures = [""] * mujoco.mjtTextureRole.mjNTEXROLE
    for index, surface in enumerate(_SURFACES):
        name = f"face_{index}"
        spec.add_texture(
            name=name,
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            builtin=surface.builtin,
            rgb1=surface.colours[0],
            rgb2=surface.colours[1],
            mark=surface.mark,
            markrgb=surface.mark_colour,
            random=0.12,  # the share of dots
            width=surface.pixels[0],
            height=surface.pixels[1],
        )
        textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
        # With texuniform, a repetition of 1 spans two metres.
        repeat = [2 / surface.span[0], 2 / surface.span[1]]
        spec.add_material(name=name, textures=textures, texrepeat=repeat, texuniform=True, specular=0, emission=0.3)
    spec.add_material(name="beacon", rgba=(0.95, 0.10, 0.10, 1.0), emission=0.5)
    # Seen at eye level, the goal's disc on the floor is hardly visible from afar.
    spec.body("goal").add_site(
        name="beacon", type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.1, 0.4, 0], pos=[0, 0, 0.4], material="beacon"
    )
