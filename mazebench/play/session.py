"""Runs the episodes of evaluations one by one, driven by a person on a page, and shows how each of them ended."""

from __future__ import annotations

import collections
import contextlib
import itertools
import pathlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import pydantic

from mazebench.agent import Observation
from mazebench.evaluation.checked_agent import CheckedAgent
from mazebench.evaluation.chunk import Chunk, Result, poses_of, run_trials
from mazebench.evaluation.measured_oracle import oracle_drives
from mazebench.evaluation.plan import Plan
from mazebench.evaluation.pool import Pool
from mazebench.play.page import Page
from mazebench.play.person import Person
from mazebench.play.scene import Scene
from mazebench.storage.json_files import read_lines, to_line

DRIVING = "driving.jsonl"  # the keys of each step of the episode that runs, with which a run that is stopped goes on


class _Step(pydantic.BaseModel):
    """A line of `DRIVING`."""

    model_config = pydantic.ConfigDict(strict=True, extra="forbid")

    episode: int
    keys: list[str]


class Session(Pool):
    """The episodes that a person drives, in the order of their plans, in this process."""

    def __init__(self, page: Page, name: str, real_time: bool):
        super().__init__(0)
        self._page, self._name, self._real_time = page, name, real_time
        self.num_ended, self.num_episodes = 0, 0  # of all evaluations; who runs them keeps both up to date

    def run(self, work: Iterable[tuple[Any, Plan, Chunk]]) -> Iterator[dict[Any, list[Result]]]:
        """Yields results as `Pool.run` does; after those of an episode, shows its end until the person goes on."""
        for key, plan, chunk in work:
            for number in chunk.numbers:
                scene, trials, results = Scene(plan, number), {number: plan.trials[number]}, list[Result]()
                with self._driven(scene, chunk.folder, number) as keys:
                    kind = plan.task.interface.actions
                    agent = CheckedAgent(plan.options.agent, Person(keys, kind), kind)
                    for results in run_trials(agent, plan.task, trials, 1, seed=plan.options.seed, keep=poses_of):
                        yield {key: results}
                (drive,) = itertools.chain.from_iterable(oracle_drives(plan.task, [*trials.values()], 1, poses_of))
                self._show(scene.end(results[0], drive), self.num_ended)
                while "next" not in self._page.wait_for_keys():
                    pass

    @contextlib.contextmanager
    def _driven(
        self, scene: Scene, folder: pathlib.Path | None, number: int
    ) -> Iterator[Callable[[Observation], Sequence[str]]]:
        """Yields a function that returns the keys of each step of an episode, and keeps them until it has ended.

        Those of an episode that was stopped are returned again.
        """
        assert folder is not None
        path = folder / DRIVING
        left = collections.deque(step for step in read_lines(path, _Step) if step.episode == number)
        with path.open("a" if left else "w", encoding="utf-8") as file:
            file.write("\n")  # ends a line that a kill cut short

            def keys(observation: Observation) -> Sequence[str]:
                scene.observe(observation)
                if left:
                    return left.popleft().keys
                self._show(scene.view(observation), self.num_ended + 1)
                pressed = self._page.wait_for_keys(self._real_time)
                file.write(to_line({"episode": number, "keys": pressed}))
                file.flush()
                return pressed

            yield keys
        path.unlink()

    def _show(self, view: dict[str, Any], number: int) -> None:
        about = {"name": self._name, "number_of": [number, self.num_episodes], "real_time": self._real_time}
        self._page.show(about | view)
