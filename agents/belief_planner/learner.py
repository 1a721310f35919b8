"""The learner of the belief planner: the belief learns from wrong maps and evidence, the rest from right maps.

`G` is the number of contexts in a batch, `S` of sequences in each, `L` of steps of a sequence, so L + 1 of states.
"""

from __future__ import annotations

from typing import Any

import torch

from mazebench.errors import InputError
from mazebench.tasks.spec import TaskSpec
from mazebench.world.lidar import Lidar

from ..common import symmetry
from ..common.actor import one_torch_thread
from ..common.descent import in_numbers
from ..common.learner import HindsightLearner
from ..muzero.batches import make_batch
from ..muzero.descent import make_descent
from ..muzero.lookahead import lookahead_targets
from ..muzero.losses import unrolled_losses
from .belief import belief_losses
from .evidence import SENSED
from .pictures import make_pictures

NUM_PAST = 120  # steps from which evidence is made


class BeliefPlannerLearner(HindsightLearner):
    """Updates the network of its actor."""

    def __init__(self, actor: Any, task: TaskSpec, seed: int):
        if task.context_size != task.size:
            found = f"mazes of {task.size} and a context of {task.context_size} cells a side"
            raise InputError(f"agent {actor.name!r}: learns from contexts of the mazes' size, found {found}")
        descent = make_descent(actor.network, actor.config)
        super().__init__(actor, task, seed, descent, keep_anchor=True)
        self.lidar = Lidar(task.mazes)

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from one batch; returns its losses and, to judge a run early, other scalars by name."""
        config, network, target_network = self.actor.config, self.actor.network, self.descent.target

        # Some sequences of the replay and what came before them, most of their goals relabelled, in the turned world.
        sample = self.replay.sample_sequences(
            config.groups,
            config.sequences,
            config.sequence_steps,
            hindsight=self.hindsight,
            rng=self.rng,
            num_past=NUM_PAST,
        )
        turned = int(self.rng.integers(symmetry.NUM_SYMMETRIES)) if config.symmetries else 0

        # Losses of the belief, from wrong maps and evidence.
        pictures = make_pictures(
            sample,
            network,
            maps=self.maps,
            turned=turned,
            lidar=self.lidar,
            wrong_maps=config.wrong_maps,
            rng=self.rng,
        )
        logits = network.belief(pictures.shown, pictures.evidence)
        of_wall, of_goal = belief_losses(logits, pictures.evidence[:, SENSED], pictures.truth)

        # Targets of values and policies in all states, by the target network, which reads the right maps.
        batch = make_batch(sample, maps=self.maps, turned=turned, context=pictures.truth, device=network.support.device)
        with torch.no_grad():
            code = target_network.hypermodel(batch.context, batch.anchor)
            latent = target_network.encode(batch.features.flatten(1, 2))  # [G, S (L + 1), D]
            targets = lookahead_targets(target_network, config, batch, latent, code)

        # Losses of the model, unrolled from some of the states.
        losses, metrics = unrolled_losses(network, config, batch, targets)
        losses |= {"wall_loss": config.belief_weight * of_wall, "goal_place_loss": config.belief_weight * of_goal}

        metrics["gradient_norm"] = self.descent.step(torch.stack(list(losses.values())).sum())
        return in_numbers(losses | metrics)
