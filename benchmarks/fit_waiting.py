"""Fits how long closed passages stay so for the navigator, on train episodes: `python -m benchmarks.fit_waiting`.

It drives without waiting through episodes of the three levels of `doors` in the mazes of `train`. Of each passage that
it sees close, the schedule tells whether that opens again and when. The estimates are those of greatest likelihood.
"""

from __future__ import annotations

import itertools

import numpy as np
from mazebench_agents.navigator import Navigator
from mazebench_agents.navigator.passages import Passages

from mazebench.envs.vector import MazeVectorEnv
from mazebench.rollout import rollout
from mazebench.tasks.schedule import FOREVER
from mazebench.tasks.streams import DOORS
from mazebench.tasks.task import Task
from mazebench.tasks.tracks import LEVELS

_NUM_ENVS, _NUM_STEPS = 48, 300


class _Watching(Navigator):
    """Sees passages close, and drives as if it did not."""

    waits = False


def seen_closings(level: int) -> list[int]:
    """Returns the steps from when passages were seen to close until they open; `FOREVER` for those that stay closed."""
    task = Task.of(DOORS, level=level, split="train")
    envs, found = MazeVectorEnv(task, _NUM_ENVS, seed=level), []
    agent = _Watching.build(task.interface)
    watched: dict[int, tuple[object, Passages]] = {}
    for step in itertools.islice(rollout(agent, envs, envs.reset(), np.zeros_like), _NUM_STEPS):
        for slot, schedule in enumerate(envs.rules.schedules()):
            memory = step.state[slot].memory
            if slot not in watched or watched[slot][0] is not memory:
                watched[slot] = memory, Passages(memory)
                continue
            passages = watched[slot][1]
            free = passages.free.copy()
            passages.update(memory)
            now = envs.rules.steps.item(slot)
            for number, times in schedule.times.items() if schedule and now else ():
                door = schedule.doors[number]
                if door.is_open and (free & passages.wall)[door.cells()].any() and times.is_away(now):
                    left = times.away - (now - times.first) % times.period
                    found.append(FOREVER if times.away == FOREVER else left)
    return found


if __name__ == "__main__":
    of_levels = {level: seen_closings(level) for level in LEVELS}
    for level, steps in of_levels.items():
        opening = [each for each in steps if each < FOREVER]
        print(f"level {level}: {len(steps)} seen to close, mean steps {np.mean(opening or [np.nan]):.1f}")
    # Each level counts as much as every other one.
    share = np.mean([np.mean(np.array(steps) < FOREVER) for steps in of_levels.values() if steps])
    means = [
        np.mean([each for each in steps if each < FOREVER]) for steps in of_levels.values() if min(steps) < FOREVER
    ]
    print(f"OPENS = {share:.2f}, STAYS = {np.mean(means):.0f}")
