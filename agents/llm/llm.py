"""The agent that plans in words: it localizes itself and drives as the navigator does, and asks for each route.

`N` is the number of cells on a side of the map, which has a cell for each of the building's.
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any, ClassVar, Self

import numpy as np

from mazebench.agent import Agent, Inputs, Interface, Report
from mazebench.errors import InputError, UnplayableError, remark
from mazebench.maps.maze import Cell
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START

from ..robot.cells import marked_cell
from ..robot.driving import Drive
from ..robot.map_matching import orientations
from ..robot.moving_body import PLAYED, as_kind, has_all_six
from ..robot.occupancy import SURE
from ..robot.senses import Memory, Senses, range_sensor, report
from .answer import Answer
from .answers import Answers
from .config import LLMConfig
from .decision import CUT, FILTERED, WITHOUT_TEXT, read_decision
from .pictures import draw_panorama
from .situation import EGOCENTRIC, NUM_VIEWS, Situation, View, facing

_NOTES = ("decisions", "not_done", "input_tokens", "output_tokens", "seconds")  # of an episode; from the third on, sums
_SAID = {  # once, of an answer that holds no decision
    CUT: "an answer was cut at max_tokens {max_tokens}, which thoughts are part of",
    FILTERED: "the service filtered an answer",
    WITHOUT_TEXT: "an answer holds no text",
}


@dataclasses.dataclass
class _Driver:
    """The robot in one environment, its route, and what was decided."""

    memory: Memory
    shown: tuple[np.ndarray, Cell | None, Cell] = dataclasses.field(init=False)  # walls, start, goal of a situation
    situation: Situation = dataclasses.field(init=False)  # the present one
    placement: tuple[int, ...] = ()  # how the map lies on the robot's grid, as `MapBelief` has it
    drive: Drive = dataclasses.field(default_factory=Drive)
    route: tuple[Cell, ...] = ()  # cells of the map ahead, the first one the robot's; one or none once it is driven
    under_way: str = ""  # the decision that led to the route
    decisions: list[str] = dataclasses.field(default_factory=list)  # with what came of them
    told: np.ndarray = dataclasses.field(init=False)  # [N, N] bool, the differing cells that a prompt has named
    views: list[View] = dataclasses.field(default_factory=list)  # that of its cell, and those at its last turns
    direction: tuple[int, ...] = ()  # from the cell before to the robot's, (rows, columns)
    step: int = 0
    notes: dict[str, Any] = dataclasses.field(default_factory=lambda: dict.fromkeys(_NOTES, 0))  # of the record

    def end_route(self, outcome: str) -> None:
        """Gives up the rest of the route, and notes what came of the decision that led to it."""
        if self.under_way:
            self.decisions.append(f"{self.under_way}: {outcome}")
        self.route, self.under_way = (), ""

    def take(self, answer: Answer) -> str:
        """Does as an answer says; without a route, the robot stays for a step. Returns the answer's flaw."""
        self.notes["decisions"] += 1
        for name in _NOTES[2:]:
            self.notes[name] += getattr(answer, name)
        decision = read_decision(answer.text, self.situation.here, len(self.situation.walls), answer.finish_reason)
        if decision.flaw:
            self.notes[decision.flaw] = self.notes.get(decision.flaw, 0) + 1
        self.end_route("given up for another one")
        seen = [cell for cell in decision.route if self.situation.seen[cell] > 0]
        if fault := decision.fault or (f"a wall was seen at {seen[0]}" if seen else ""):
            self.notes["not_done"] += 1
            self.decisions.append(f"{decision.said}: not done, {fault}")
        elif decision.route:
            self.route, self.under_way = decision.route, decision.said
        else:
            self.decisions.append(f"{decision.said}: waited")
        return decision.flaw


class LLM(Agent):
    """Asks for a route where the last one ends, or a wall stands in it; told, also where something differs."""

    plays_actions = PLAYED
    needs_shown = ("map", "goal")
    read_sensors = staticmethod(range_sensor)
    eval_config: ClassVar[LLMConfig] = LLMConfig()

    def __init__(self, interface: Interface, config: LLMConfig, folder: pathlib.Path | None):
        """Keeps its answers in `folder`; raises `UnplayableError` if the map has other cells than the building."""
        size, side = interface.size, interface.context_size
        if side != size:
            raise UnplayableError(f"agent 'llm': expected the building's {size} x {size} cells, found {side} x {side}")
        self._config, self._kind, self._senses = config, interface.actions, Senses(interface, "llm")
        self._body, self._camera = interface.body, interface.camera
        if config.see == EGOCENTRIC:
            interface.require_sensor("egocentric", "llm")
        self._answers, self._flaws = Answers(config, folder), {""}
        # For each way in which the map may be turned, the place of each of its cells on the turned map, as numbers.
        turned = orientations(np.arange(size**2).reshape(size, size), 8)
        self._turned = np.argsort(turned.reshape(8, -1), axis=1)

    @classmethod
    def build(cls, interface: Interface, *, config: Any = None, folder: Any = None, **others: Any) -> Self:
        """Returns an agent for the interface's mazes."""
        return cls(interface, config or cls.eval_config, folder)

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution."""
        return size

    def initial_state(self, batch_size: int) -> list[_Driver | None]:
        """Returns no drivers yet: one is made where an episode begins."""
        if self._config.model.startswith("person:") and batch_size > 1:
            raise InputError(f"expected --num-envs 1 for a person, found {batch_size} episodes side by side")
        return [None] * batch_size

    def act(self, inputs: Inputs, state: list[Any], explore: bool = False) -> tuple[np.ndarray, list[Any]]:
        """Returns actions `[B]`; what is asked in a step, in all environments, is asked at once."""
        actions = np.zeros(len(state), dtype=np.int64)
        slots = range(len(state)) if inputs.active is None else np.flatnonzero(inputs.active).tolist()
        inputs = self._senses.look(inputs)
        drivers = {slot: self._observe(state[slot], inputs, slot) for slot in slots}
        asking = {slot: asked for slot, driver in drivers.items() if (asked := self._question(driver))}
        for slot, answer in zip(asking, self._answers.of([*asking.values()]), strict=True):
            if (flaw := drivers[slot].take(answer)) not in self._flaws:
                self._flaws.add(flaw)
                said = _SAID[flaw].format(max_tokens=self._config.max_tokens)
                why = f" (finish_reason {answer.finish_reason!r})" if answer.finish_reason else ""
                remark(f"agent 'llm': {said}{why}, so it is no decision; such answers are counted in the summary")
        for slot, driver in drivers.items():
            # The route on the robot's grid.
            (turn, row, column), size = driver.placement, len(driver.situation.walls)
            numbers = [self._turned[turn, r * size + c].item() for r, c in driver.route]
            path = [(number // size - row, number % size - column) for number in numbers]
            (walls, _), strafes = driver.memory.estimate(), has_all_six(self._kind, self._body)
            state[slot], actions[slot] = driver, driver.drive.follow(path, walls, driver.memory, strafes)
        return as_kind(self._kind, actions, self._body), state

    def report(self, state: list[_Driver | None]) -> Report:
        """Returns where the robots are on the maps, and the numbers of decisions and tokens."""
        poses = report(driver.memory if driver else None for driver in state)
        return poses._replace(notes=[driver.notes.copy() if driver else None for driver in state])

    def _observe(self, driver: _Driver | None, inputs: Inputs, slot: int) -> _Driver:
        """Returns the driver after an observation; a new one where an episode begins."""
        memory = self._senses.observe(driver.memory if driver else None, inputs, slot)
        if driver is None or driver.memory is not memory:
            driver = _Driver(memory)
        driver.step += 1
        if inputs.new_context[slot]:
            driver.end_route("another goal began")
            context = inputs.observation["context"][slot]
            start = marked_cell(context[START]) if context[START].any() else None
            driver.shown = context[GLOBAL_MAP] > 0.5, start, marked_cell(context[GOAL])
            driver.told = np.zeros(context[GLOBAL_MAP].shape, dtype=bool)

        # How the map lies on the grid, and what was seen of it. Where that changes, a route leads elsewhere.
        belief, size = memory.belief, len(driver.shown[0])
        turn, row, column = belief.placements[belief.log_weights.argmax()].tolist()
        if driver.placement not in ((), (turn, row, column)):
            driver.end_route("the robot changed its mind about where it is on the map")
            driver.told[:], driver.views = False, []
        driver.placement = turn, row, column
        evidence = memory.evidence[-row : size - row, -column : size - column]
        seen = (np.sign(evidence) * (np.abs(evidence) >= SURE)).astype(np.int8)
        driver.situation = Situation(
            *driver.shown,
            seen=seen.ravel()[self._turned[turn]].reshape(size, size),
            pose=belief.on_map(memory.body.x, memory.body.y, memory.body.yaw),
            certainty=float(belief.weights.max()),
            step=driver.step,
            told=self._config.mode == "told",
            seed=int(inputs.seed[slot]),
            see=self._config.see,
        )
        if self._config.see == EGOCENTRIC:
            self._look(driver, inputs.observation["egocentric"][slot])

        # The rest of the route; it goes on from a cell beside it.
        here = driver.situation.here
        away = [abs(r - here[0]) + abs(c - here[1]) for r, c in driver.route]
        rest = driver.route[int(np.argmin(away)) :] if away else ()
        driver.route = rest if here in rest else (here, *rest) if 1 in away else ()
        return driver

    def _look(self, driver: _Driver, picture: np.ndarray) -> None:
        """Takes in what the camera sees. Of the cells before, views are kept where its way turned."""
        situation = driver.situation
        is_all_round = self._camera is not None and self._camera.fov == 360
        yaw = situation.pose[2]
        image, faces = (draw_panorama(picture, yaw), "") if is_all_round else (picture.copy(), facing(yaw))
        view, before = View(image, driver.step, situation.here, faces), driver.views[:1]
        if before and before[0].cell != view.cell:
            direction = tuple(np.sign(np.subtract(view.cell, before[0].cell)).tolist())
            goes_on = direction == driver.direction
            driver.views, driver.direction = [view, *driver.views[goes_on:]][:NUM_VIEWS], direction
        else:
            driver.views[:1] = [view]
        driver.situation = situation._replace(views=tuple(driver.views))

    def _question(self, driver: _Driver) -> Situation | None:
        """Returns what a driver asks; None if it needs no decision. A route that is driven or blocked ends."""
        situation, route, memory = driver.situation, driver.route, driver.memory
        blocked = [cell for cell in route[1:] if situation.seen[cell] > 0]
        # In the goal's cell it drives on to the middle, since the body may yet be outside.
        arrives = route == (situation.goal,) and not memory.searched[memory.cell]
        if blocked:
            driver.end_route(f"stopped, a wall is in the way at {blocked[0]}")
        elif len(route) <= 1 and not arrives:
            driver.end_route("done" if route else "the robot left the route")
        is_news = situation.told and (situation.differing & ~driver.told).any()
        if (driver.route and not is_news) or driver.notes["decisions"] >= self._config.max_decisions:
            return None
        driver.told |= situation.differing
        decisions = driver.decisions + [f"{driver.under_way}: under way"] * bool(driver.under_way)
        quoted = tuple(decisions[max(0, len(decisions) - self._config.history) :])
        return situation._replace(decisions=quoted, number=driver.notes["decisions"] + 1)


class ScriptBFS(LLM):
    """A script that never revises the map."""

    eval_config = LLMConfig(model="script:bfs")


class ScriptTold(LLM):
    """A script that revises the map as it is told."""

    eval_config = LLMConfig(model="script:told", mode="told")


class ScriptHope(LLM):
    """A script that takes what was seen as it is, and hopes for doors where nothing was seen."""

    eval_config = LLMConfig(model="script:hope")
