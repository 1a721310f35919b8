"""The contract of an agent: what it is given, what it answers, and what its class may declare.

`B` is the number of environments that an agent acts in at once, `N` the cells a side of their mazes and `M` the side of
the context's planes.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import pathlib
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from mazebench.options import Options
from mazebench.tasks.context import default_context_size
from mazebench.tasks.interface import Interface as Interface

Observation = dict[str, np.ndarray]  # "state" [B, 12] float32, "context" [B, 4, M, M] float32, sensors by name


class Truth(NamedTuple):
    """The true state of B environments, for agents that declare `needs_truth`."""

    walls: np.ndarray  # [B, N, N] bool, the true maze
    pose: np.ndarray  # [B, 3] float64, x and y (m) and yaw (rad)
    goal: np.ndarray  # [B, 2] int, the present goal's cell (row, column)
    doors: Any = None  # where doors move: B of `mazebench.tasks.schedule.Schedule`


class Inputs(NamedTuple):
    """Everything that an agent is given before one step in B environments; the caller owns the arrays.

        >>> inputs.observation["state"].shape, inputs.new_episode.shape
        ((64, 12), (64,))

    Observations are arrays by name, in float32 with a first axis of B, as `mazebench.make_vec` gives them.
    """

    observation: Observation
    new_episode: np.ndarray  # [B] bool, whether an episode begins with this step
    new_context: np.ndarray  # [B] bool, whether the context is new: an episode, or the leg to another goal, begins
    seed: np.ndarray  # [B] int64, of the running episode, for the agent's own random draws
    truth: Truth | None = None  # only for agents that declare `needs_truth`
    # [B] bool, False where an environment rests because no episode is left; None if all of them run
    active: np.ndarray | None = None


class Report(NamedTuple):
    """An agent's own account of a step that it took; None where it gives none.

        >>> mazebench.Report(pose=np.array([[2.5, 3.5, 0.0]])).notes is None
        True

    From `SingleAgent.report`, both are without the axis B.
    """

    # [B, 3] float: x, y (m) and yaw (rad) of the body on the map that is shown, whose lower left corner is (0, 0) and
    # whose cells are as wide as the maze's; NaN where it is not known.
    pose: np.ndarray | None = None
    notes: Sequence[Any] | None = None  # B values that JSON can hold, each of them perhaps None


@dataclasses.dataclass(frozen=True, kw_only=True)
class AgentConfig(Options):
    """Base of an agent's config, a frozen dataclass whose values `mazebench eval --set KEY=VALUE` replaces."""

    def identity(self) -> dict[str, Any]:
        """Returns what may change results, as values that JSON can hold: by default all fields.

        `mazebench render --results` takes these values from other people's files. Leave out addresses and secrets.
        """
        return dataclasses.asdict(self)

    @property
    def needs_one_process(self) -> bool:
        """True if an evaluation must not be spread over worker processes."""
        return False

    @property
    def needs_one_machine(self) -> bool:
        """True if an evaluation must not be spread over machines, as where the agent keeps files."""
        return self.needs_one_process


class _Declarations:
    """Declarations that the class of an agent may make; each has a default."""

    # The defaults of the agent's config. With one, `build` is given two more arguments: `config`, and `folder`, that of
    # the results, in which the agent may keep files of its own; None if there is none.
    eval_config: ClassVar[AgentConfig | None] = None

    needs_truth: ClassVar[bool] = False  # results of an agent that does are labelled as privileged
    needs_sensors: ClassVar[tuple[str, ...]] = ()  # an evaluation adds them, unless sensors are named
    # The kinds of actions that it can answer with: "six", "four", "velocity", "diff"; without "six", it is given the
    # first one.
    plays_actions: ClassVar[tuple[str, ...]] = ("six",)
    needs_shown: ClassVar[tuple[str, ...]] = ()  # of "map" and "goal": what it can't play without
    learns: ClassVar[bool] = False  # an agent that does can be given a checkpoint, even if it ships with none

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns a new agent, here `cls()`.

        Args:
          interface: the environments that it will act in.
          seed: of what is drawn when it is built, such as weights; draws in an episode belong to `Inputs.seed`.
          checkpoint: the file to read instead of `default_checkpoint()`; only for agents that learn.

        Raises:
          InputError: if the checkpoint can't be used.
          UnplayableError: if the agent can't play in such environments; a suite leaves such a part out.
        """
        return cls()

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns the M that the agent needs in mazes of `size` cells a side, here min(N, 21)."""
        return default_context_size(size)

    @classmethod
    def read_sensors(cls, sensors: tuple[str, ...]) -> tuple[str, ...]:
        """Returns those of some sensors that the agent reads, here all; an evaluation names the others in a line."""
        return sensors

    @classmethod
    def map_reader(cls, interface: Interface) -> pathlib.Path | None:
        """Returns the file of a network of its own by which it reads the maps of such environments; None without one.

        Results have the file's hash.
        """
        return None

    @classmethod
    def default_checkpoint(cls) -> pathlib.Path | None:
        """Returns the file that `build` reads if it is given none; None if the agent reads no checkpoint."""
        return None


class Agent(_Declarations):
    """Acts in B environments at once; the base class of all agents.

    All that an agent remembers is in its state, which `initial_state` and `act` return. Between steps it keeps nothing
    on itself, because one agent may play several batches of episodes in turn.

        >>> class Forward(mazebench.Agent):
        ...     def act(self, inputs, state, explore=False):
        ...         return np.zeros(len(inputs.seed), int), state  # 0 is forward

    An evaluation ends with an `AgentError` that names the agent's line if a method raises or returns something else.
    """

    def initial_state(self, batch_size: int) -> Any:
        """Returns the state before the first step in `batch_size` environments, here None."""
        return None

    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, Any]:
        """Returns actions and the next state: `[B]` int, or velocities `[B, 3]` or `[B, 2]` float from -1 to 1.

        What an agent does in an episode must depend on that episode alone, and not on its position in the batch.

        Args:
          inputs: what is given before this step, not to be changed.
          state: what the last call returned, or `initial_state`; the agent may change it in place.
          explore: whether to act as in training; an evaluation never sets it.
        """
        raise NotImplementedError

    def report(self, state: Any) -> Report:
        """Returns where the body was at the observation that `act` was given last, and notes; by default nothing.

        An evaluation calls it after each step. It changes nothing. The poses give the recall of localization in the
        results, and an episode's last notes go into its record.

        Args:
          state: what `act` returned.
        """
        return Report()


class SingleAgent(_Declarations):
    """Acts in one environment; an evaluation runs a copy of the agent in each of B environments.

    Each episode is played by a fresh copy of what `build` returned, so an agent may keep on itself whatever it likes:
    nothing carries over to another episode. The attributes below are set before each call of a method.

        >>> class Forward(mazebench.SingleAgent):
        ...     def act(self, observation):
        ...         return 0  # forward
        >>> mazebench.evaluate(Forward, distances=(1,)).overall.success_rate
    """

    seed: int  # of the episode, for the agent's own random draws
    new_episode: bool  # whether an episode begins with this step
    truth: Truth | None = None  # without the axis B; only for agents that declare `needs_truth`

    def reset(self, observation: Observation) -> None:
        """Takes in a new context: an episode, or the leg to the next landmark or goal, begins.

        `act` follows with the same observation.
        """

    def act(self, observation: Observation) -> int | np.ndarray:
        """Returns an action: one of six, or velocities `[3]` or `[2]` from -1 to 1, as `plays_actions` declares.

        The six are forward, backward, strafe left, strafe right, look left and look right, from 0 to 5. Velocities are
        shares of the top speeds: forward, left and turn, or forward and turn.

        Args:
          observation: "state" `[12]`, "context" `[4, M, M]`, and sensors by name, such as "lidar" `[32]` in metres; not
            to be changed.
        """
        raise NotImplementedError

    def report(self) -> Report:
        """Returns where the body was at the last observation, `pose` `[3]`, and `notes`; see `Agent.report`."""
        return Report()


class _SingleAgents(Agent):
    """Runs a `SingleAgent` in each of B environments; the state is the list of their copies."""

    single_class: ClassVar[type[SingleAgent]]

    def __init__(self, built: SingleAgent, resting: np.ndarray):
        self._built, self._resting = built, resting  # the agent, and the action where no episode is left

    @classmethod
    def build(cls, interface: Interface, **given: Any) -> Self:
        built = cls.single_class.build(interface, **given)
        return cls(built, np.zeros(interface.action_shape, dtype=np.int64))

    def initial_state(self, batch_size: int) -> list[SingleAgent]:
        return [self._built] * batch_size

    def act(self, inputs: Inputs, state: list[SingleAgent], explore: bool = False) -> tuple[np.ndarray, Any]:
        return np.array([self._act_in(slot, inputs, state) for slot in range(len(state))]), state

    def _act_in(self, slot: int, inputs: Inputs, state: list[SingleAgent]) -> int | np.ndarray:
        if inputs.active is not None and not inputs.active[slot]:
            return self._resting
        observation = {name: values[slot] for name, values in inputs.observation.items()}
        if inputs.new_episode[slot]:
            state[slot] = copy.deepcopy(self._built)
        agent = state[slot]
        agent.seed, agent.new_episode = int(inputs.seed[slot]), bool(inputs.new_episode[slot])
        if inputs.truth is not None:
            truth = inputs.truth
            doors = None if truth.doors is None else truth.doors[slot]
            agent.truth = Truth(truth.walls[slot], truth.pose[slot], truth.goal[slot], doors)
        if inputs.new_context[slot]:
            agent.reset(observation)
        return agent.act(observation)

    def report(self, state: list[SingleAgent]) -> Report:
        reports = [agent.report() for agent in state]
        if not all(isinstance(each, Report) for each in reports):
            return next(each for each in reports if not isinstance(each, Report))  # which an evaluation refuses
        poses, notes = zip(*reports, strict=True)
        unknown = np.full(3, np.nan)
        are_known = any(pose is not None for pose in poses)
        return Report(np.array([unknown if pose is None else pose for pose in poses]) if are_known else None, notes)


@functools.cache  # so that a class and its import by name give one and the same
def as_agent_class(declared: type[Agent] | type[SingleAgent]) -> type[Agent]:
    """Returns `declared` itself if it is an `Agent`, else an `Agent` that runs the `SingleAgent` in B environments."""
    if issubclass(declared, Agent):
        return declared
    # Named as the class that it wraps, for messages and provenance.
    declarations = ("eval_config", "needs_truth", "needs_sensors", "needs_shown", "plays_actions", "learns")
    methods = ("context_size", "read_sensors", "map_reader", "default_checkpoint")
    names = ("__module__", "__qualname__", "__doc__", *declarations, *methods)
    attributes = {name: getattr(declared, name) for name in names}
    return type(declared.__name__, (_SingleAgents,), attributes | {"single_class": declared})
