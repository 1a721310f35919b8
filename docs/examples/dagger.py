"""Imitates the oracle on the track building: clones its drives, then has its own labelled (DAgger, Ross et al. 2011).

python docs/examples/dagger.py --out student.pt     (a minute and a half on one core)

The network need not learn to plan: it reads how far the places around the body are from the goal, by a breadth-first
search on the shown map. It learns to drive. `B` is the number of environments, `M` the side of the map in cells of 1 m.
"""

import argparse

import numpy as np
import torch
from mazebench_agents import expert
from torch import nn

import mazebench

POINTS, SPACING = 9, 0.5  # a grid around the body: points on a side, m between them
AHEAD, LEFT = np.meshgrid(*2 * [SPACING * (np.arange(POINTS) - POINTS // 2)], indexing="ij")
FAR = 6.0  # cells; places that are more than this nearer to the goal or farther from it look alike
NUM_FEATURES = 2 * POINTS**2 + 7 + 32
NUM_ENVS, STEPS_PER_ROUND, UPDATES_PER_ROUND, BATCH_SIZE = 32, 40, 60, 512


def cells_left(walls, goal):
    """Returns `[M, M]` float32: the cells of way to the goal on a map; 1,000 where none leads there."""
    left = np.full(walls.shape, 1000, np.float32)
    front, num_cells = np.zeros_like(walls), 0
    front[goal] = True
    while front.any():
        left[front] = num_cells
        num_cells += 1
        rows, columns = np.nonzero(front)
        front = np.zeros_like(walls)
        for row, column in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            front[rows + row, columns + column] = True
        front &= ~walls & (left == 1000)
    return left


class Maps:
    """The maps of B environments."""

    def __init__(self, num_envs, side):
        self.walls = np.zeros((num_envs, side, side), bool)
        self.left = np.zeros((num_envs, side, side), np.float32)  # cells of way to the goal

    def read(self, contexts, is_new):
        """Reads those of the contexts `[B, 4, M, M]` that are new: walls are in plane 0, the goal is in plane 2."""
        for i in np.flatnonzero(is_new):
            self.walls[i] = contexts[i, 0] > 0.5
            self.left[i] = cells_left(self.walls[i], np.unravel_index(contexts[i, 2].argmax(), self.walls[i].shape))

    def features(self, observation):
        """Returns `[B, NUM_FEATURES]` float32, in the body's frame."""
        state = observation["state"]
        x, y, yaw = state[:, 0, None], state[:, 1, None], state[:, 5, None]
        cos, sin = np.cos(yaw), np.sin(yaw)
        around = self.cells(x + cos * AHEAD.ravel() - sin * LEFT.ravel(), y + sin * AHEAD.ravel() + cos * LEFT.ravel())
        farther = np.clip((self.left[around] - self.left[self.cells(x, y)]) / FAR, -1, 1)
        off_x, off_y = x % 1 - 0.5, y % 1 - 0.5  # m from the centre of the cell
        pose = [cos * off_x + sin * off_y, cos * off_y - sin * off_x, np.cos(4 * yaw), np.sin(4 * yaw)]
        motion = [state[:, 6:8] / 3, state[:, 11:] / 3]
        parts = [self.walls[around], farther, *pose, *motion, observation["lidar"] / 5]
        return np.concatenate(parts, axis=1, dtype=np.float32)

    def cells(self, x, y):
        """Returns the indices of the cells of points `[B, K]`; points outside of the map count as its border."""
        last = self.walls.shape[1] - 1
        row, column = last - np.floor(y).astype(int), np.floor(x).astype(int)
        return np.arange(len(x))[:, None], row.clip(0, last), column.clip(0, last)


def make_network():
    return nn.Sequential(nn.Linear(NUM_FEATURES, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, 6))


class Student(mazebench.Agent):
    """Does what the network takes for the expert's action."""

    needs_sensors = ("lidar",)
    learns = True

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        if checkpoint is None:
            raise mazebench.InputError("expected --checkpoint, a file that dagger.py wrote, found none")
        student = cls()
        student.side, student.network = interface.context_size, make_network()
        student.network.load_state_dict(torch.load(checkpoint, weights_only=True))
        return student

    def initial_state(self, batch_size):
        return Maps(batch_size, self.side)

    def act(self, inputs, maps, explore=False):
        maps.read(inputs.observation["context"], inputs.new_context)
        with torch.no_grad():
            return self.network(torch.as_tensor(maps.features(inputs.observation))).argmax(dim=1).numpy(), maps


def train(num_steps, seed):
    """Returns a network that learned from the expert's labels of `num_steps` steps."""
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network = make_network()
    optimizer = torch.optim.Adam(network.parameters(), 1e-3)
    envs = mazebench.make_vec("building", NUM_ENVS, kinds=("dfs", "house", "rooms"), fresh=True)
    maps = Maps(NUM_ENVS, envs.task.context_size)
    observation, info = envs.reset(seed=seed)
    rows, labels, reached = [], [], []
    num_rounds = max(2, num_steps // (STEPS_PER_ROUND * NUM_ENVS))
    for number in range(num_rounds):
        # Collect: the expert drives and is cloned; then the student drives, and the expert says what it would do.
        expert_drives = number < num_rounds / 5
        for _ in range(STEPS_PER_ROUND):
            maps.read(observation["context"], info["is_first"])
            rows.append(torch.as_tensor(maps.features(observation)))
            labels.append(torch.as_tensor(expert.labels(envs)))
            with torch.no_grad():
                actions = labels[-1] if expert_drives else network(rows[-1]).argmax(dim=1)
            observation, _, terminated, truncated, info = envs.step(actions.numpy())
            reached += terminated[terminated | truncated].tolist()
        # Learn from all rounds.
        all_rows, all_labels = torch.cat(rows), torch.cat(labels)
        for _ in range(UPDATES_PER_ROUND):
            batch = torch.as_tensor(rng.integers(len(all_rows), size=BATCH_SIZE))
            loss = nn.functional.cross_entropy(network(all_rows[batch]), all_labels[batch])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        if number % 5 == 4:
            print(f"{len(all_rows):,} labels; {sum(reached)} of the last {len(reached)} goals were reached")
            reached.clear()
    envs.close()
    return network


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--steps", type=int, default=60_000, help="agent steps of the training")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", default="student.pt")
    parser.add_argument("--distances", type=int, nargs="+", help="cells from start to goal in the evaluation")
    arguments = parser.parse_args()
    torch.save(train(arguments.steps, arguments.seed).state_dict(), arguments.out)
    task = mazebench.Task.of("building", split="dev", distances=arguments.distances)
    found = mazebench.evaluate(Student, task, checkpoint=arguments.out)
    print(f"saved {arguments.out}; success rate on dev {found.overall.success_rate:.3f}, {found.episodes} episodes")
