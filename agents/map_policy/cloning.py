"""The learner of the map policy: imitation, with new pictures and a turned world in each minibatch."""

from __future__ import annotations

import numpy as np
import torch

from mazebench.constants import NUM_ACTIONS
from mazebench.maps.maze import cell_to_point
from mazebench.tasks.task import Task
from mazebench.training.experience import Experience
from mazebench.world.looks import LOOKS, PLAIN, VARIED, Camera, exposures_of
from mazebench.world.ray_camera import RayCamera

from ..common.rollouts import Rows, Seen
from ..common.symmetry import NUM_SYMMETRIES, turn_actions, turn_planes
from ..imitation import ImitatingAgent, ImitationLearner
from ..robot.cells import marked_cell


class CloningLearner(ImitationLearner):
    """Keeps where the bodies were, not what they saw: pictures are drawn for each minibatch, in either look."""

    def __init__(self, actor: ImitatingAgent, task: Task, seed: int):
        """The pictures are of the mazes of `task`."""
        super().__init__(actor, task, seed)
        self._cameras = {look: RayCamera(task.standing, Camera(), look) for look in LOOKS}

    def seen(self, experience: Experience) -> Seen:
        """Adds mazes and true poses to what the actor noted, and the oracle's labels."""
        shared, (pose, velocity, label) = super().seen(experience)
        return Seen(shared, (experience.maze, experience.pose, pose, velocity, label))

    def losses(self, rows: Rows) -> dict[str, torch.Tensor]:
        """Returns the losses of rows, each map turned by a symmetry, as if the drives had been in another maze."""
        maze, true_pose, pose, velocity, label = rows.parts
        pictures = self._pictures(rows, maze.numpy(), true_pose.numpy())
        symmetry = self.rng.integers(NUM_SYMMETRIES, size=len(rows.shared))
        return super().losses(turned(symmetry, rows._replace(parts=(pose, velocity, pictures, label))))

    def _pictures(self, rows: Rows, maze: np.ndarray, pose: np.ndarray) -> torch.Tensor:
        """Returns pictures `[R, 64, 64, 3]` uint8 in one of the two looks."""
        look, count = VARIED if self.rng.random() < 0.5 else PLAIN, len(maze)
        goals = np.array([marked_cell(each) for each in rows.shared[:, 1].numpy()])
        marker = np.pad(cell_to_point(goals, rows.shared.shape[-1]), ((0, 0), (0, 1)))  # on the floor
        gain, noise_at = np.ones(count, np.float32), np.full(count, -1)
        if look == VARIED:
            gain, noise_at = exposures_of(self.rng, count)
        on_floor = marker[rows.group.numpy()]
        return torch.from_numpy(
            self._cameras[look].take(("egocentric",), maze, pose, on_floor, gain, noise_at)["egocentric"]
        )


def turned(symmetry: np.ndarray, rows: Rows) -> Rows:
    """Returns rows in the world turned by the symmetries `[G]` (see `common.symmetry`) of their maps `[G, 2, L, L]`.

    The parts of rows are poses, velocities, pictures and labels.
    """
    pose, velocity, pictures, label = rows.parts
    size, (x, y, yaw), (forward, left) = rows.shared.shape[-1], pose.unbind(1), velocity.unbind(1)
    of_row = torch.from_numpy(symmetry)[rows.group]
    is_mirrored = of_row >= 4
    x, yaw, left = (torch.where(is_mirrored, *each) for each in ((size - x, x), (torch.pi - yaw, yaw), (-left, left)))
    for turn in range(1, 4):
        is_turned = of_row % 4 >= turn
        x, y = torch.where(is_turned, size - y, x), torch.where(is_turned, x, y)
        yaw = torch.where(is_turned, yaw + torch.pi / 2, yaw)
    pictures = torch.where(is_mirrored[:, None, None, None], pictures.flip(2), pictures)
    label = torch.where(is_mirrored[:, None], label[:, turn_actions(np.arange(NUM_ACTIONS), symmetry=4)], label)
    maps = torch.stack([turn_planes(each, turn) for each, turn in zip(rows.shared, symmetry.tolist(), strict=True)])
    return Rows(
        maps, rows.group, (torch.stack([x, y, yaw], dim=1), torch.stack([forward, left], dim=1), pictures, label)
    )
