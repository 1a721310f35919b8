"""Collecting experience in environments of one task, or of several tracks."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from mazebench.envs.vector import MazeVectorEnv
from mazebench.rollout import Step, rollout
from mazebench.tasks.task import Task
from mazebench.training.experience import Experience, Scene
from mazebench.training.protocol import LearningAgent

_SEEDS = 2**31


class Collector:
    """B environments in which an agent collects experience; of several tasks, each episode draws one."""

    def __init__(self, tasks: Task | Sequence[Task], num_envs: int, num_threads: int = 0):
        """The tasks are one, or those of `tasks_of_tracks`; `num_envs` is B, `num_threads` 0 for all cores."""
        self._envs = MazeVectorEnv(tasks, num_envs, num_threads=num_threads)
        self._task = self._envs.task

    def limit_distances(self, longest: int) -> None:
        """Sends the agent to goals at most so far away from now on, in the unit of the task's option `distances`."""
        distances = self._task.options.distances or ()
        self._envs.draw_distances([each for each in distances if each <= longest] or [min(distances)])

    def collect(
        self,
        actor: LearningAgent,
        seed: int,
        driven: Callable[[Scene, np.ndarray], np.ndarray] = lambda scene, actions: actions,
        drive_steps: int = 0,
    ) -> Iterator[Experience]:
        """Begins new trajectories, the same for the same `seed`, and yields the exploring agent's steps without end.

        `driven` and `drive_steps` are those of the `Learner`; by default the agent drives, until episodes end.
        """
        root = np.random.SeedSequence(seed)
        first = self._envs.reset(seed=root.generate_state(self._envs.num_envs).tolist())
        # What an agent draws from must not let it reconstruct its episode's flips, warp or noise.
        rng = np.random.default_rng(root.spawn(1)[0])
        actor.explore_from(seed)
        while True:
            scene = self._scene()
            steps = rollout(
                actor,
                self._envs,
                first,
                lambda slots: rng.integers(_SEEDS, size=len(slots)),
                explore=True,
                driven=lambda actions: driven(self._scene(), actions),
            )
            for step in itertools.islice(steps, drive_steps - 1 if drive_steps else None):
                before, scene = scene, self._scene()
                yield self._experience(step, before, seed, actor)
            yield self._experience(next(steps), scene, seed, actor, is_cut=True)
            first = self._envs.reset()

    def _experience(
        self, step: Step, scene: Scene, seed: int, actor: LearningAgent, is_cut: bool = False
    ) -> Experience:
        """Returns a step that began in `scene`; all trajectories end with it if `is_cut`."""
        observation = step.inputs.observation
        final_state = step.next_observation["state"] if is_cut else np.zeros_like(observation["state"])
        final_cell = self._scene().cell if is_cut else np.zeros(len(step.ended), dtype=np.int64)
        if step.ended.any():
            for slot in np.flatnonzero(step.ended):
                final_state[slot] = step.next_info["final_obs"][slot]["state"]
            # All mazes have one size and one cell size.
            last = self._task.mazes[0].cell_index(step.next_info["final_info"]["position"])
            final_cell = np.where(step.ended, last, final_cell) if is_cut else last
        return Experience(
            **scene._asdict(),
            state=observation["state"],
            action=step.actions,
            new_episode=step.inputs.new_episode,
            new_context=step.inputs.new_context,
            reward=step.reward,
            terminated=step.terminated,
            ended=step.ended | is_cut,
            final_state=final_state,
            final_cell=final_cell,
            context=observation["context"],
            sensors={name: observation[name] for name in self._task.options.sensors},
            stream=seed,
            notes=actor.notes(step.state),
        )

    def _scene(self) -> Scene:
        """Returns the truth of the environments now."""
        rules, velocity = self._envs.rules, self._envs.velocity()
        cell, pose, maze, start, goal, step = (
            array.copy() for array in (rules.cell, rules.pose, rules.maze, rules.start, rules.target, rules.steps)
        )
        return Scene(cell, pose, velocity, maze, start, goal, step, rules.schedules())
