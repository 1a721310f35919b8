"""Runs some of an evaluation's episodes, as many side by side as there are environments.

`B` is the number of environments.
"""

from __future__ import annotations

import collections
import contextlib
import dataclasses
import pathlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mazebench.agent import Agent, Observation
from mazebench.constants import YAW, X, Y
from mazebench.envs.vector import MazeVectorEnv
from mazebench.evaluation.plan import Plan, build_agent
from mazebench.evaluation.reports import Hit, hit, recalls
from mazebench.maps.maze import Cell
from mazebench.results.metrics import spl
from mazebench.results.records import Count, Length, Record
from mazebench.results.trajectories import Trajectory
from mazebench.rollout import agent_seed, rollout
from mazebench.tasks.episode import Episode, schedule_of
from mazebench.tasks.observation import state_errors
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.task import Task
from mazebench.tasks.trials import Leg, Trial, shortest_path

# Returns B values to keep of a moment, from what is observed and the infos of B environments, and from the actions that
# follow; None after the last one.
Keep = Callable[[Observation, dict[str, Any], np.ndarray | None], Sequence[Any]]


class Result(NamedTuple):
    """The result of an episode, or of one leg of an episode with several goals."""

    number: Count  # of the trial
    success: bool
    steps: Count
    path_length: Length  # m
    blocked: bool  # whether a wall stands in the shortest path on the shown map
    kept: Sequence[Any] | np.ndarray  # of each moment, the last one included; empty if nothing is kept
    reported: Mapping[str, Any] = {}  # further keys of the record, of what the agent reported
    leg: Count = 1  # of the episode's goals, counted from 1
    after_miss: Cell | None = None  # where the leg began if the goal before was missed
    waited: Count = 0  # steps in which the body hardly moved


class Chunk(NamedTuple):
    """Some episodes of a plan, for one process to run."""

    numbers: Sequence[int]  # of the plan's trials
    num_envs: int  # environments side by side
    num_threads: int  # of the simulation; 0 for all cores
    keep: Keep | None = None  # what to keep of each moment of the episodes
    folder: pathlib.Path | None = None  # of the results


@dataclasses.dataclass
class _Slot:
    """The episode that runs in an environment."""

    number: int  # of the trial
    shown: ShownMap
    start: int  # the cell in which the running leg began, as row * N + column
    begun: float = 0.0  # m driven in the episode when the running leg began
    kept: list[Any] = dataclasses.field(default_factory=list)  # of the running leg, as `Result` has it
    hits: list[Hit | None] = dataclasses.field(default_factory=list)  # of its steps
    legs: list[Result] = dataclasses.field(default_factory=list)  # that have ended

    def end_leg(self, final: dict[str, Any], blocked: bool, notes: Any, task: Task) -> None:
        """Adds the result of the running leg, after which the environment has the infos `final`."""
        has_missed = bool(self.legs) and not self.legs[-1].success
        driven = final["path_length"].item()
        self.legs.append(
            Result(
                number=self.number,
                success=final["goal_reached"].item(),
                steps=final["steps"].item() - sum(leg.steps for leg in self.legs),
                path_length=driven - self.begun,
                blocked=blocked,
                kept=self.kept,
                reported=recalls(self.hits) | ({} if notes is None else {"notes": notes}),
                leg=len(self.legs) + 1,
                after_miss=divmod(self.start, task.size) if has_missed else None,
                waited=final["waited"].item() - sum(leg.waited for leg in self.legs),
            )
        )
        self.kept, self.hits, self.begun = [], [], driven


def run_chunk(plan: Plan, chunk: Chunk) -> Iterator[list[Result]]:
    """Yields the results of the episodes that ended, after each step; each once, in no fixed order."""
    for results in run_trials(
        build_agent(plan.options, plan.task, plan.agent_class, chunk.folder),
        plan.task,
        {number: plan.trials[number] for number in chunk.numbers},
        chunk.num_envs,
        chunk.num_threads,
        seed=plan.options.seed,
        needs_truth=plan.agent_class.needs_truth,
        keep=chunk.keep,
    ):
        # Poses are packed for their way to another process.
        yield [result._replace(kept=np.array(result.kept)) for result in results] if chunk.keep is poses_of else results


def run_trials(
    agent: Agent,
    task: Task,
    trials: Mapping[int, Trial],
    num_envs: int,
    num_threads: int = 0,
    *,
    seed: int = 0,
    needs_truth: bool = False,
    keep: Keep | None = None,
) -> Iterator[list[Result]]:
    """Yields the results of the trials that ended, after each step; each once, in no fixed order.

    The results of an episode's legs follow each other.

    Args:
      agent: acts without exploring.
      task: the task, with the mazes that the trials index.
      trials: the episodes to run, by their numbers.
      num_envs: environments side by side, at most; results of an agent that keeps its contract do not depend on it.
      num_threads: of the simulation; 0 for all cores.
      seed: of what the agent draws; with a trial's number it gives the seed of the episode's draws.
      needs_truth: whether the agent is given the true maze and pose.
      keep: what to keep of each moment of the episodes.
    """
    if not trials:
        return

    num_envs = min(num_envs, len(trials))
    # The longest ways first, so that no environment is left alone with one at the end.
    queue = collections.deque(sorted(trials, key=lambda number: -trials[number].shortest_path))
    numbers = [-1] * num_envs  # of the trial in each environment; -1 where none is left

    def next_episode(index: int) -> Episode | None:
        numbers[index] = queue.popleft() if queue else -1
        return None if numbers[index] < 0 else trials[numbers[index]].episode

    def seeds(indices: np.ndarray) -> list[int]:
        return [agent_seed(seed, numbers[index]) for index in indices]

    env = MazeVectorEnv(task, num_envs, num_threads=num_threads, episode_source=next_episode)
    with contextlib.closing(env):
        rules, first = env.rules, env.reset()

        def begin(index: int) -> _Slot | None:
            shown = rules.shown[index]
            return (
                None if numbers[index] < 0 or shown is None else _Slot(numbers[index], shown, rules.start.item(index))
            )

        slots = [begin(index) for index in range(num_envs)]
        for step in rollout(agent, env, first, seeds, needs_truth=needs_truth):
            poses = np.column_stack([step.info["position"], step.info["yaw"]])
            report = agent.report(step.state)
            moments = keep(step.inputs.observation, step.info, step.actions) if keep else None
            for index, slot in enumerate(slots):
                if slot is not None:
                    slot.hits.append(hit(slot.shown, poses[index], None if report.pose is None else report.pose[index]))
                    slot.kept += [] if moments is None else [moments[index]]

            results: list[Result] = []
            leg_ended = step.ended | (step.next_info["is_first"] & (task.options.num_goals > 1))
            for index in np.flatnonzero(leg_ended).tolist():
                slot = slots[index]
                assert slot is not None
                # The last moment of the leg, where the next one begins unless the episode has ended.
                if step.ended[index]:
                    observation, infos = step.next_info["final_obs"][index], step.next_info["final_info"]
                else:
                    observation = {name: values[index] for name, values in step.next_observation.items()}
                    infos = rules.infos()
                final = {name: values[index : index + 1] for name, values in infos.items()}
                if keep:
                    slot.kept.extend(keep({name: value[None] for name, value in observation.items()}, final, None))
                notes = None if report.notes is None else report.notes[index]
                slot.end_leg(final, step.info["blocked"].item(index), notes, task)
                slot.start = rules.start.item(index)
                if step.ended[index]:
                    results += slot.legs
                    slots[index] = begin(index)
            yield results


def poses_of(observation: Observation, info: dict[str, Any], actions: np.ndarray | None) -> Sequence[Any]:
    """Returns `[B, 6]` float32: the true and the observed poses, x and y in metres and yaw in rad."""
    poses = np.column_stack([info["position"], info["yaw"], observation["state"][:, (X, Y, YAW)]])
    return poses.astype(np.float32)  # type: ignore[return-value]  # an array is as good as a sequence


def to_trajectory(plan: Plan, result: Result) -> Trajectory | None:
    """Returns the trajectory of an episode of a plan, or of a leg of it; None if it was not kept."""
    if not len(result.kept):
        return None
    task, poses = plan.task, np.asarray(result.kept)
    is_wrong = task.options.track is not None and state_errors(task, plan.trials[result.number].episode)
    return Trajectory(poses[:, :3], poses[:, 3:] if is_wrong else None)


def to_record(plan: Plan, result: Result) -> Record:
    """Returns the record of an episode of a plan, or of a leg of it."""
    task, trial = plan.task, plan.trials[result.number]
    episode, leg = trial.episode, trial.legs[result.leg - 1]
    maze = task.mazes[episode.maze]
    if (start := result.after_miss) is not None:
        leg = Leg(start, leg.goal, maze.distance(start, leg.goal), shortest_path(maze, start, leg.goal, task.body))
    # Of the body as a disc, and from cell to cell; both in metres.
    shortest = np.array([leg.shortest_path, leg.distance * task.cell_size])
    spl_of_disc, spl_grid = spl(np.array([result.success]), shortest, np.array([result.path_length])).tolist()
    values = {
        "agent": plan.options.agent,
        "task": task.options.task,
        "size": task.size,
        "split": task.options.split_in_results,
        "episode": result.number,
        "maze": maze.name,
        "start": leg.start,
        "goal": leg.goal,
        "distance": leg.distance,
        "success": result.success,
        "steps": result.steps,
        "path_length": result.path_length,
        "shortest_path": leg.shortest_path,
        "spl": spl_of_disc,
        "spl_grid": spl_grid,
        "seed": episode.seed,
        "leg": result.leg,
        "oracle_steps": leg.oracle_steps,
    }
    is_track, schedule = task.options.track is not None, schedule_of(task, episode)
    optional = {
        "cell_size": None if task.cell_size == 1 else task.cell_size,
        "level": task.options.track_level if is_track else None,
        **task.options.noise,
        **task.options.perturbations,
        # Summaries report the episodes of each of these groups apart.
        "blocked": result.blocked if is_track else None,
        "waited": result.waited if schedule is not None else None,
        "doors": None if schedule is None else schedule.rows(),
        "after_miss": result.after_miss is not None if len(trial.legs) > 1 else None,
        "kind": (maze.kind or None) if is_track else None,
    }
    told = {name: value for name, value in optional.items() if value is not None}
    return Record.model_validate(values | told | dict(result.reported))
