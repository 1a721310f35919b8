"""A maze as a MuJoCo model: merged wall boxes, floor, lights, cameras, and a body that moves like DeepMind Lab's.

Lengths are metres; 1 m stands for 100 game units of DeepMind Lab. The body slides along x and y and
yaws; height, roll and pitch are fixed. The constants below are fitted to measurements in DeepMind Lab, which
docs/task.md lists.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from mazebench.constants import ACTIONS, MAX_PIXELS, PHYSICS_TIMESTEP, TOP_SPEED
from mazebench.errors import InputError
from mazebench.maps import colors
from mazebench.maps.maze import WALL_HEIGHT, Maze
from mazebench.world import looks

BODY_RADIUS = 0.15  # DeepMind Lab's box is 30 x 30 x 56 units
BODY_HEIGHT = 0.56
TURN_RATE = np.deg2rad(2.112) / 0.016  # rad/s: 20 pixels of 0.1056 degrees a frame of 16 ms

# A drive that is on adds the force gain * (speed - v) to linear damping; the two balance at TOP_SPEED.
_DAMPING = 8.0
_DRIVE_GAIN = 60.0
_DRIVE_SPEED = TOP_SPEED * (1 + _DAMPING / _DRIVE_GAIN)
_DRIVE_FORCE = 34.0  # caps the acceleration from rest
_YAW_GAIN = 20.0  # with _YAW_INERTIA a time constant of 1 ms, well within a frame
_YAW_INERTIA = 0.02
# Metres before a wall at which contacts act, so that the body never sinks in. The margins of two geoms add up, so the
# body has none.
CONTACT_MARGIN = 0.03
# As stiff as the timestep allows, and overdamped: with a damping ratio of 1 up to 18 % of the speed rebounds.
_CONTACT_SOLREF = [2 * PHYSICS_TIMESTEP, 3.0]
_CONTACTS: dict[str, Any] = {"condim": 1, "margin": CONTACT_MARGIN, "solref": _CONTACT_SOLREF}  # of walls
MAX_BOXES = 32_768  # of a whole model; the time that MuJoCo takes for them, 2 s, grows with the square
_PARKED_DEPTH = 10.0  # metres below the floor

# The columns of `sensordata`, in the order in which `_add_sensors` adds them.
SENSED_POSITION = slice(0, 3)
SENSED_YAW = 3
SENSED_VELOCITIES = slice(4, 10)  # linear, then angular

# The columns of controls, in the order in which `_add_actuators` adds them: four drives and the turn.
NUM_CONTROLS = 5
_FORWARD, _BACKWARD, _LEFT, _RIGHT, _TURN = range(NUM_CONTROLS)


def maze_spec(maze: Maze, for_robot: bool = False) -> mujoco.MjSpec:
    """Returns the whole model of one maze, which `mazebench generate` writes.

    A model to put a robot into has walls and a floor that carries, gravity and MuJoCo's own options, and no bodies.

    Raises:
      InputError: if it has more boxes than MuJoCo puts together in some seconds.
    """
    if len(maze.boxes) > MAX_BOXES:
        raise InputError(
            f"{maze.name}: expected a maze of at most {MAX_BOXES} wall boxes for a whole model, found "
            f"{len(maze.boxes)}; the Gymnasium and vector environments take it"
        )
    spec = boxes_spec(maze, *wall_boxes(maze), for_robot)
    spec.modelname = maze.name
    return spec


def largest_spec(maze: Maze) -> mujoco.MjSpec:
    """Returns the whole model of a maze, or one without walls if it has too many boxes for that."""
    return maze_spec(maze) if len(maze.boxes) <= MAX_BOXES else boxes_spec(maze, *np.zeros((2, 0, 3)))


def wall_boxes(maze: Maze) -> tuple[np.ndarray, np.ndarray]:
    """Returns the middles and half sides (`[K, 3]` m) of all wall boxes of a maze."""
    top, left, bottom, right = np.array(maze.boxes).T
    return placed_boxes(top, left, bottom, right, maze.size, maze.cell_size)


def boxes_spec(maze: Maze, middle: np.ndarray, half: np.ndarray, for_robot: bool = False) -> mujoco.MjSpec:
    """Returns a model with the floor, body and goal of `maze`, and wall boxes of its own.

    Args:
      maze: where the body begins, in its first free cell.
      middle: `[K, 3]` m, of the boxes.
      half: `[K, 3]` m, their half sides.
      for_robot: see `maze_spec`.
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
        _add_body(spec, maze)
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


def _add_body(spec: mujoco.MjSpec, maze: Maze) -> None:
    x, y = maze.point(maze.free_cells[0])
    # The joints measure from the world's origin, so qpos is (x, y, yaw). Keyframe 0 is in the first free cell.
    body = spec.worldbody.add_body(name="agent", pos=[0, 0, BODY_HEIGHT / 2])
    body.add_joint(name="x", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1, 0, 0], damping=[_DAMPING, 0, 0])
    body.add_joint(name="y", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 1, 0], damping=[_DAMPING, 0, 0])
    body.add_joint(name="yaw", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    body.mass = 1.0
    body.inertia = [_YAW_INERTIA] * 3
    body.ipos = [0, 0, 0]
    body.explicitinertial = True

    body.add_geom(
        name="agent",
        type=mujoco.mjtGeom.mjGEOM_CAPSULE,
        size=[BODY_RADIUS, BODY_HEIGHT / 2 - BODY_RADIUS, 0],
        material="agent",
        condim=1,
        solref=_CONTACT_SOLREF,
    )
    body.add_site(
        name="nose", type=mujoco.mjtGeom.mjGEOM_BOX, pos=[0.11, 0, 0.02], size=[0.06, 0.09, 0.05], material="nose"
    )
    body.add_site(name="agent", pos=[0, 0, 0], size=[0.01, 0.01, 0.01], group=4)

    # The camera looks along the body's x axis: its right is -y, its up is z. The nose is below its view.
    camera = looks.Camera()
    eye = [camera.offset, 0, camera.height - BODY_HEIGHT / 2]
    body.add_camera(name="egocentric", pos=eye, xyaxes=[0, -1, 0, 0, 0, 1], fovy=camera.fov)
    # Between narrow walls, it is nearer and looks down more steeply.
    behind = min(1.0, maze.cell_size)
    body.add_camera(name="chase", pos=[-1.6 * behind, 0, 2.2], xyaxes=[0, -1, 0, 0.75, 0, 0.66 * behind], fovy=60)

    _add_actuators(spec)
    _add_sensors(spec)
    spec.add_key(name="start", qpos=[x, y, 0], mpos=[0, 0, -_PARKED_DEPTH], mquat=[1, 0, 0, 0])


def _add_actuators(spec: mujoco.MjSpec) -> None:
    directions = ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0])
    for name, direction in zip(ACTIONS[:4], directions, strict=True):
        spec.add_actuator(
            name=name,
            trntype=mujoco.mjtTrn.mjTRN_SITE,
            target="agent",
            refsite="",
            gear=[*direction, 0, 0, 0],
            gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
            gainprm=[_DRIVE_GAIN * _DRIVE_SPEED, 0, -_DRIVE_GAIN] + [0] * 7,
            ctrllimited=True,
            ctrlrange=[0, 1],
            forcelimited=True,
            forcerange=[0, _DRIVE_FORCE],
        )
    turn = spec.add_actuator(
        name="turn",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target="yaw",
        ctrllimited=True,
        ctrlrange=[-TURN_RATE, TURN_RATE],
    )
    turn.set_to_velocity(kv=_YAW_GAIN)


def _add_sensors(spec: mujoco.MjSpec) -> None:
    site = mujoco.mjtObj.mjOBJ_SITE
    spec.add_sensor(name="position", type=mujoco.mjtSensor.mjSENS_FRAMEPOS, objtype=site, objname="agent")
    spec.add_sensor(name="yaw", type=mujoco.mjtSensor.mjSENS_JOINTPOS, objtype=mujoco.mjtObj.mjOBJ_JOINT, objname="yaw")
    spec.add_sensor(name="velocity", type=mujoco.mjtSensor.mjSENS_VELOCIMETER, objtype=site, objname="agent")
    spec.add_sensor(name="angular_velocity", type=mujoco.mjtSensor.mjSENS_GYRO, objtype=site, objname="agent")


def action_controls() -> np.ndarray:
    """Returns the controls of the four drives and the turn for each of `ACTIONS`: `[6, 5]` float."""
    controls = np.zeros((len(ACTIONS), NUM_CONTROLS))
    for drive in (_FORWARD, _BACKWARD, _LEFT, _RIGHT):
        controls[drive, drive] = 1.0
    controls[ACTIONS.index("look_left"), _TURN] = TURN_RATE
    controls[ACTIONS.index("look_right"), _TURN] = -TURN_RATE
    return controls


def velocity_controls(velocities: np.ndarray) -> np.ndarray:
    """Returns the controls that drive the body at `[..., 3]` velocities: `[..., 5]` float.

    A velocity is (forward, left, turn to the left) in the body's frame, each in [-1, 1]: forward and left in shares of
    the top speed, the turn in shares of the turn rate. If forward and left together exceed the top speed, they are
    shortened to it. With one of the three at 1 or -1 and the others at 0, the controls are those of an action. With
    all at 0 the body coasts.
    """
    forward, left, turn = np.moveaxis(velocities, -1, 0)
    excess = np.maximum(1.0, np.hypot(forward, left))
    controls = np.zeros((*velocities.shape[:-1], NUM_CONTROLS))
    for ahead, back, share in ((_FORWARD, _BACKWARD, forward / excess), (_LEFT, _RIGHT, left / excess)):
        # The control under which drive and damping balance at `share * TOP_SPEED`.
        control = _DAMPING * np.abs(share) / (_DRIVE_GAIN * (1 - np.abs(share)) + _DAMPING)
        controls[..., ahead] = np.where(share > 0, control, 0.0)
        controls[..., back] = np.where(share < 0, control, 0.0)
    controls[..., _TURN] = TURN_RATE * turn
    return controls
