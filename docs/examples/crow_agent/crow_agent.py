"""An agent that heads for the goal as the crow flies, and slides along whatever walls it meets."""

import numpy as np

import mazebench


class Crow(mazebench.Agent):
    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        return cls(interface.size)

    def __init__(self, size):
        self.size = size  # cells a side of the maze

    def act(self, inputs, state, explore=False):
        body, goals = inputs.observation["state"], inputs.observation["context"][:, 2]  # [B, 12], [B, M, M]
        num_cells = goals.shape[-1]
        row, column = np.divmod(goals.reshape(len(goals), -1).argmax(axis=1), num_cells)
        x, y = (column + 0.5) * self.size / num_cells, self.size - (row + 0.5) * self.size / num_cells
        bearing = np.arctan2(y - body[:, 1], x - body[:, 0]) - body[:, 5]
        bearing = (bearing + np.pi) % (2 * np.pi) - np.pi  # to the left of where it looks
        turn = np.where(bearing > 0, 4, 5)  # look left, look right
        return np.where(np.abs(bearing) < 0.2, 0, turn), state  # forward where it looks at the goal
