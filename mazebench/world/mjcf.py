"""A maze as a MuJoCo model: merged wall boxes, floor, lights, cameras, and a body. Lengths are metres."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mazebench.constants import MAX_PIXELS, PHYSICS_TIMESTEP
from mazebench.errors import InputError
from mazebench.maps import colors
from mazebench.maps.maze import WALL_HEIGHT, Maze
from mazebench.world import looks
from mazebench.world.bodies import SLIDER, Body
from mazebench.world.bodies.body import CONTACT_MARGIN, CONTACT_SOLREF

_CONTACTS: dict[str, Any] = {"condim": 1, "margin": CONTACT_MARGIN, "solref": CONTACT_SOLREF}  # of walls
MAX_BOXES = 32_768  # of a whole model; the time that MuJoCo takes for them, 2 s, grows with the square
_PARKED_DEPTH = 10.0  # metres below the floor


def maze_spec(maze: Maze, for_robot: bool = False, body: Body = SLIDER) -> mujoco.MjSpec:
    """Returns the whole model of one maze with a body, which `mazebench generate` writes.

    A model to put a robot into has walls and a floor that carries, gravity and MuJoCo's own options, and no bodies.

    Raises:
      InputError: if it has more boxes than MuJoCo puts together in some seconds.
    """
    if len(maze.boxes) > MAX_BOXES:
        raise InputError(
            f"{maze.name}: expected a maze of at most {MAX_BOXES} wall boxes for a whole model, found "
            f"{len(maze.boxes)}; the Gymnasium and vector environments take it"
        )
    spec = boxes_spec(maze, *wall_boxes(maze), body=body, for_robot=for_robot)
    spec.modelname = maze.name
    return spec


def largest_spec(maze: Maze, body: Body) -> mujoco.MjSpec:
    """Returns the whole model of a maze, or one without walls if it has too many boxes for that."""
    if len(maze.boxes) > MAX_BOXES:
        return boxes_spec(maze, *np.zeros((2, 0, 3)), body=body)
    return maze_spec(maze, body=body)


def wall_boxes(maze: Maze) -> tuple[np.ndarray, np.ndarray]:
    """Returns the middles and half sides (`[K, 3]` m) of all wall boxes of a maze."""
    top, left, bottom, right = np.array(maze.boxes).T
    return placed_boxes(top, left, bottom, right, maze.size, maze.cell_size)


def boxes_spec(
    maze: Maze, middle: np.ndarray, half: np.ndarray, *, body: Body, for_robot: bool = False
) -> mujoco.MjSpec:
    """Returns a model with the floor and goal of `maze`, a body, and wall boxes of its own.

    Args:
      maze: where the body begins, in its first free cell.
      middle: `[K, 3]` m, of the boxes.
      half: `[K, 3]` m, their half sides.
      body: what is driven.
      for_robot: see `maze_spec`; there is no body then.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "maze"
    if not for_robot:
        spec.option.timestep = PHYSICS_TIMESTEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.gravity = [0, 0, 0]

    # Set, not computed by MuJoCo, so that models of one size share camera and shadow ranges.
    spec.stat.center = [maze.side / 2, maze.side / 2, WALL_HEIGHT / 2]
    spec.stat.extent = maze.side
    spec.stat.meansize = 0.5

    spec.visual.map.znear = 0.02 / maze.side
    offscreen = getattr(spec.visual, "global")  # a keyword of Python
    offscreen.offwidth = MAX_PIXELS
    offscreen.offheight = MAX_PIXELS
    spec.visual.headlight.ambient = [looks.AMBIENT] * 3
    spec.visual.headlight.diffuse = [looks.HEADLIGHT] * 3
    spec.visual.headlight.specular = [0, 0, 0]

    _add_materials(spec, maze)
    _add_room(spec, maze.side, for_robot)
    contacts = {} if for_robot else _CONTACTS
    for index, (pos, size) in enumerate(zip(middle, half, strict=True)):
        spec.worldbody.add_geom(
            name=f"wall_{index}", type=mujoco.mjtGeom.mjGEOM_BOX, pos=pos, size=size, material="wall", **contacts
        )
    if not for_robot:
        _add_goal(spec, maze.cell_size)
        body.add_to(spec, behind=min(1.0, maze.cell_size))
        pose = [*maze.point(maze.free_cells[0]), 0]
        spec.add_key(name="start", qpos=pose, mpos=[0, 0, -_PARKED_DEPTH], mquat=[1, 0, 0, 0])
    return spec


def _add_materials(spec: mujoco.MjSpec, maze: Maze) -> None:
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=looks.SKY_COLOR,
        rgb2=looks.HORIZON_COLOR,
        width=64,
        height=64,
    )
    # The middle of the texture lies on the middle of the floor, which is the middle of a cell if its number of cells
    # is odd, else a corner.
    lines = mujoco.mjtMark.mjMARK_EDGE if maze.size % 2 else mujoco.mjtMark.mjMARK_CROSS
    spec.add_texture(
        name="cells",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        mark=lines,
        rgb1=looks.FLOOR_COLOR,
        rgb2=looks.FLOOR_COLOR,
        markrgb=looks.LINE_COLOR,
        width=128,
        height=128,
    )
    textures = [""] * mujoco.mjtTextureRole.mjNTEXROLE
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "cells"
    # With texuniform, a repetition of 1 spans two metres.
    repeat = 2 / maze.cell_size
    spec.add_material(name="floor", textures=textures, texrepeat=[repeat, repeat], texuniform=True)
    spec.add_material(name="wall", rgba=[*looks.WALL_COLOR, 1])
    spec.add_material(name="agent", rgba=[0.90, 0.45, 0.13, 1])
    spec.add_material(name="nose", rgba=[0.15, 0.15, 0.18, 1])
    spec.add_material(name="goal", rgba=[*colors.GOAL, 0.7], emission=0.1)


def _add_room(spec: mujoco.MjSpec, side: float, carries: bool) -> None:
    middle = side / 2
    world = spec.worldbody
    # Without a robot, the floor is only seen: our body's height is fixed, so it needs no contact.
    world.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        pos=[middle, middle, 0],
        size=[middle, middle, 0.1],
        material="floor",
        contype=int(carries),
        conaffinity=int(carries),
    )
    world.add_light(
        name="sun",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[middle, middle, 2 * side],
        dir=looks.SUN_DIRECTION,
        diffuse=[looks.SUN] * 3,
        castshadow=False,  # its shadow map is too coarse for large mazes
    )
    # High and narrow, so that walls hardly lean outwards; about 1.04 * side at the walls' height fill the view.
    height = 4.0 * side
    fovy = np.rad2deg(2 * np.arctan(0.52 * side / (height - WALL_HEIGHT)))
    world.add_camera(name="top", pos=[middle, middle, height], quat=[1, 0, 0, 0], fovy=fovy)


def placed_boxes(
    top: np.ndarray, left: np.ndarray, bottom: np.ndarray, right: np.ndarray, size: int, cell_size: float
) -> tuple[np.ndarray, np.ndarray]:
    """Returns the middles and half sides (`[..., 3]` m) of wall boxes of a maze of `size` cells a side.

    A box covers the cells of rows [top, bottom) and columns [left, right), `[...]` int each.
    """
    middle, half = np.full((2, *top.shape, 3), WALL_HEIGHT / 2)
    middle[..., 0] = cell_size * (left + right) / 2
    middle[..., 1] = cell_size * (size - (top + bottom) / 2)
    half[..., 0] = cell_size * (right - left) / 2
    half[..., 1] = cell_size * (bottom - top) / 2
    return middle, half


def parked_boxes(count: int, cell_size: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns the middles and half sides (`[count, 3]` m) of boxes below the floor, apart from each other."""
    middle, half = np.full((count, 3), cell_size * 0.5), np.full((count, 3), 0.1)
    middle[:, 0] = cell_size * (np.arange(count) + 0.5)
    middle[:, 2] = -_PARKED_DEPTH
    return middle, half


def _add_goal(spec: mujoco.MjSpec, cell_size: float) -> None:
    """Adds the marker of the goal. The task moves it by its mocap pose; nothing collides with it."""
    marker = spec.worldbody.add_body(name="goal", mocap=True, pos=[0, 0, -_PARKED_DEPTH])
    marker.add_site(
        name="goal",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[0.3 * cell_size, 0.02, 0],
        pos=[0, 0, 0.02],
        material="goal",
    )
