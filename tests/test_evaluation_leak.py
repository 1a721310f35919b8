"""An agent can't find out from its inputs what was hidden from it."""

from __future__ import annotations

import pathlib
from typing import ClassVar

import numpy as np
from mazebench_agents.planner import ClosedLoopPlanner
from run_folders import records_of

from mazebench.agent import Agent
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.plan import make_plan
from mazebench.rollout import agent_seed
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations.flip_warp_noise import MapFlip
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.rules import Rules


class Undoing(ClosedLoopPlanner):
    """A planner that takes its seed for the episode's, draws the flips with it, and takes them back."""

    episode_seeds: ClassVar[dict[int, int]] = {}  # by the agent's, if it was told

    def act(self, inputs, state, explore=False):
        context = inputs.observation["context"].copy()
        for planes, seed in zip(context, inputs.seed, strict=True):
            ends = tuple(tuple(np.argwhere(planes[plane])[0].tolist()) for plane in (START, GOAL))
            seed = self.episode_seeds.get(int(seed), int(seed))
            rng = Episode(0, *ends, 0.0, seed).stream(MapFlip.stream)
            planes[GLOBAL_MAP] = MapFlip(0.1).shown(ShownMap(planes[GLOBAL_MAP] > 0.5), ends, rng).walls
        return super().act(inputs._replace(observation={**inputs.observation, "context": context}), state, explore)


def test_results_do_not_depend_on_what_info_tells_of_the_truth(monkeypatch, tmp_path):
    def play(out: pathlib.Path) -> list[dict]:
        evaluate("navigator", out=out, task="rebuilt", split="dev", distances=(15,))
        return records_of(out)

    honest, infos = play(tmp_path / "honest"), Rules.infos
    # Of what records are made: recalls compare reported poses with the true ones.
    recorded = ("is_first", "success", "goal_reached", "steps", "path_length", "blocked", "position", "yaw")

    def lying(rules: Rules) -> dict[str, np.ndarray]:
        told = infos(rules)
        return {name: values if name in recorded else np.zeros_like(values) for name, values in told.items()}

    monkeypatch.setattr(Rules, "infos", lying)
    assert play(tmp_path / "lying") == honest


def test_a_planner_that_undoes_flips_with_its_seed_does_no_better(monkeypatch, tmp_path):
    options = {"split": "train", "distances": (10,), "episodes_per_distance": 2, "map_flip": 0.1}

    def successes(agent: str | type[Agent], out: pathlib.Path) -> np.ndarray:
        evaluate(agent, out=out, **options)
        return np.array([record["success"] for record in records_of(out)], dtype=float)

    honest = successes("planner-closed-loop", tmp_path / "honest")
    more = successes(Undoing, tmp_path / "undoing") - honest
    assert more.mean() <= 2 * more.std(ddof=1) / len(more) ** 0.5
    # If it were told the episodes' seeds, it would do better, and this test would see that.
    trials = make_plan(eval_options("random", **options)).trials
    told = {agent_seed(0, index): trial.episode.seed for index, trial in enumerate(trials)}
    monkeypatch.setattr(Undoing, "episode_seeds", told)
    assert successes(Undoing, tmp_path / "told").mean() >= honest.mean() + 0.2
