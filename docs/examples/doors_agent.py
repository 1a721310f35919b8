"""An agent that waits: it follows the shortest path on the map, and stands before doors that are closed now."""

import numpy as np

import mazebench

_SEES = 1.6  # m, to the middle of the next cell and somewhat beyond


class WaitingFollower(mazebench.SingleAgent):
    """Drives cell by cell, and turns on the spot while its lidar sees a wall where the map shows none."""

    needs_sensors = ("lidar",)

    def reset(self, observation):
        walls, _, goal, _ = observation["context"]  # [31, 31] each; 1 where a wall or the goal is
        self.way = np.where(goal > 0, 0, np.inf)  # cells to the goal
        for _ in range(walls.size):
            near = np.min([np.roll(self.way, shift, axis) for shift in (1, -1) for axis in (0, 1)], axis=0)
            self.way = np.where(walls > 0, np.inf, np.minimum(self.way, near + 1))

    def act(self, observation):
        x, y, yaw = observation["state"][[0, 1, 5]]  # metres from the lower left corner, and radians
        if abs(np.sin(2 * yaw)) > 0.36:
            return 4  # looks left until it stands along the corridors
        row, column = int(31 - y), int(x)  # of cells that are a metre wide
        cells = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)]
        row, column = min(cells, key=lambda cell: self.way[cell])
        bearing = np.arctan2(30.5 - row - y, column + 0.5 - x) - yaw
        ray = round(bearing / (2 * np.pi) * 32) % 32  # towards the next cell
        far = np.hypot(30.5 - row - y, column + 0.5 - x)  # m, to its middle
        if observation["lidar"][ray] < min(far, _SEES):
            return 4  # a closed door: it waits
        return [0, 2, 1, 3][round(bearing / (np.pi / 2)) % 4]  # forward, left, backward or right
