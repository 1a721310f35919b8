"""The losses of MMN's model, unrolled from encoded states: against experience, and against planned targets.

`G` is the number of contexts in a batch, `S` of sequences in each, `L` of steps of a sequence, so L + 1 of states. A
root is a state from which the model is unrolled for `K` steps; `R` roots belong to a context.
"""

from __future__ import annotations

import torch
from torch.nn import functional

from ..common.layers import VALUE_UNIT
from .hypermodel import Code, MMNNetwork
from .mmn_config import MMNConfig
from .targets import Batch, Targets, n_step_returns

_HIDDEN_GRADIENT = 0.5  # of an unrolled state at each step: MuZero's
_MOVED_WEIGHT = 2.0  # of an error of metres moved, beside one of the body's motion


class Means:
    """Weighted means of values that are added step by step."""

    def __init__(self) -> None:
        self._sums: dict[str, torch.Tensor] = {}
        self._weights: dict[str, torch.Tensor] = {}

    def add(self, name: str, values: torch.Tensor, weight: torch.Tensor) -> None:
        """Adds `values` with `weight`, an array of the same shape."""
        weight = weight.to(values.dtype)
        total, weights = (values * weight).sum(), weight.sum()
        if name in self._sums:
            total, weights = self._sums[name] + total, self._weights[name] + weights
        self._sums[name], self._weights[name] = total, weights

    def means(self) -> dict[str, torch.Tensor]:
        """Returns the means by name; 0 where all weights are 0."""
        return {name: total / self._weights[name].clamp(min=1e-6) for name, total in self._sums.items()}


def unrolled_losses(
    network: MMNNetwork, config: MMNConfig, batch: Batch, targets: Targets
) -> tuple[dict[str, torch.Tensor], dict[str, torch.Tensor]]:
    """Returns losses by name, to be summed, and other scalars by name.

    The scalar `map_ratio` tells how much the map matters to the model: its error after one step with the weights
    generated for another maze of the batch, over its error with its own weights.

    The losses are the paper's task losses (of values, policies and ends) at the roots and, weighted by 1 / K, in K
    unrolled states, and its auxiliary model loss in the unrolled states. `config` has their weights, and K.
    """
    code = network.hypermodel(batch.context, batch.anchor)
    roots = slice(0, config.sequence_steps - config.unroll + 1, config.unroll)

    def at(values: torch.Tensor, step: int) -> torch.Tensor:
        """Returns `[G, R, ...]` of `[G, S, L + 1, ...]`: the states `step` steps after the roots."""
        return values[:, :, roots.start + step : roots.stop + step : roots.step].flatten(1, 2)

    latent = network.encode(at(batch.features, 0))
    alive = at(batch.exists & ~batch.at_goal, 0)
    losses, watched = Means(), Means()
    for step in range(config.unroll + 1):
        exists = at(batch.exists, step) & alive if step else at(batch.exists, 0)
        at_goal, value = at(batch.at_goal, step), at(targets.value, step)
        share = 1 / config.unroll if step else 1.0

        # The task losses.
        seen = network.look(latent, code)
        out = network.predict(latent, seen, code)
        going = exists & ~at_goal
        losses.add("value_loss", cross_entropy(two_hot(value, network.num_bins), out.value_logits), going * share)
        losses.add("policy_loss", cross_entropy(at(targets.policy, step), out.policy_logits), going * share)
        ends = functional.binary_cross_entropy_with_logits(out.goal_logit, at_goal.float(), reduction="none")
        losses.add("goal_loss", ends, exists * share)
        if step:
            # The model loss is the negative log-likelihood of the state: of pose and velocities with a Laplace
            # distribution, since collisions are heavy-tailed, and of the whole latent state with a normal one.
            features, decoded = at(batch.features, step), network.decode(latent)
            with torch.no_grad():
                encoded = network.encode(features)
            moved_error = (decoded[..., :2] - features[..., :2]).abs().sum(dim=-1)
            body_error = (decoded[..., 2:] - features[..., 2:7]).abs().sum(dim=-1)
            latent_error = ((latent - encoded) ** 2).mean(dim=-1)
            model_loss = config.model_weight * (_MOVED_WEIGHT * moved_error + body_error + latent_error)
            losses.add("model_loss", model_loss, exists * share)
            if step in (1, config.unroll):
                watched.add(f"model_error_{step}", moved_error.detach(), exists)
        else:
            error = (network.value(out.value_logits.detach()) - value) * going
            watched.add("value_error", error.abs(), going)
            watched.add("value", value, going)

            # The model's error after one step with the weights of another maze of the batch.
            with torch.no_grad():
                other = Code(code.positions, *(part.roll(1, 0) for part in code[1:]))
                first = network.first_layer(latent, network.look(latent, other), other)
                moved = network.decode(network.step(latent, first, at(batch.action, 0), other))[..., :2]
            is_other = (batch.maze != batch.maze.roll(1, 0))[:, None]
            error = (moved - at(batch.features, 1)[..., :2]).abs().sum(dim=-1)
            watched.add("model_error_other_map", error, at(batch.exists, 1) & alive & is_other)

        # Unroll, with half of the gradient.
        if step < config.unroll:
            first = network.first_layer(latent, seen, code)
            latent = network.step(latent, first, at(batch.action, step), code)
            latent = latent * _HIDDEN_GRADIENT + latent.detach() * (1 - _HIDDEN_GRADIENT)
    metrics = watched.means()
    metrics["map_ratio"] = metrics.pop("model_error_other_map") / metrics["model_error_1"].clamp(min=1e-6)
    return losses.means(), metrics


def q_losses(
    network: MMNNetwork, target_network: MMNNetwork, config: MMNConfig, batch: Batch
) -> tuple[dict[str, torch.Tensor], dict[str, torch.Tensor]]:
    """Returns losses by name, to be summed, and other scalars by name: what is learned without a model.

    Action values learn n-step returns along the experience, which end with the target network's value of the action
    that `network` chooses (double Q-learning, van Hasselt et al. 2016). Ends are learned as with a model, since they
    teach the position on the map.
    """
    states, features = batch.exists.shape[1:], batch.features.flatten(1, 2)

    def predict(network: MMNNetwork) -> list[torch.Tensor]:
        """Returns action values `[G, S, L + 1, 6]` and goal logits `[G, S, L + 1]`."""
        code = network.hypermodel(batch.context, batch.anchor)
        return [out.unflatten(1, states) for out in network.predict_without_model(network.encode(features), code)]

    values, goal_logit = predict(network)
    with torch.no_grad():
        best = values.argmax(dim=-1, keepdim=True)
        bootstrap = predict(target_network)[0].gather(-1, best)[..., 0]
        returns = n_step_returns(bootstrap, batch.at_goal, batch.exists, config.n_step)[..., :-1]
        returns = returns.clamp(-config.longest_value, 0.0)

    # Of the actions that were taken, in states before the last one and outside of the goal.
    taken = values[..., :-1, :].gather(-1, batch.action[..., None])[..., 0]
    going = batch.exists[..., 1:] & ~batch.at_goal[..., :-1]
    losses, watched = Means(), Means()
    losses.add("value_loss", functional.smooth_l1_loss(taken, returns, reduction="none") / VALUE_UNIT, going)
    ends = functional.binary_cross_entropy_with_logits(goal_logit, batch.at_goal.float(), reduction="none")
    losses.add("goal_loss", ends, batch.exists)
    watched.add("value_error", (taken.detach() - returns).abs(), going)
    watched.add("value", returns, going)
    return losses.means(), watched.means()


def two_hot(value: torch.Tensor, num_bins: int) -> torch.Tensor:
    """Returns values `[...]` as weights `[..., bins]` of the two nearest integers in [1 - bins, 0]."""
    position = (value + (num_bins - 1)).clamp(0, num_bins - 1)
    low = position.floor().clamp(max=num_bins - 2)
    share = (position - low)[..., None]
    low = low.long()
    return functional.one_hot(low, num_bins) * (1 - share) + functional.one_hot(low + 1, num_bins) * share


def cross_entropy(target: torch.Tensor, logits: torch.Tensor) -> torch.Tensor:
    """Returns the cross-entropy `[...]` of logits under target probabilities, both `[..., n]`."""
    return -(target * logits.log_softmax(dim=-1)).sum(dim=-1)
