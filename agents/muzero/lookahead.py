"""One step of lookahead in a latent model, and the targets that follow from it.

`G` is the number of contexts, `K` of latent states in each.
"""

from __future__ import annotations

import torch

from .batches import Batch
from .config import MuZeroConfig
from .network import NUM_ACTIONS, Code, Network, Predictions
from .targets import Targets, tree_backup_returns


def outcome(predictions: Predictions) -> tuple[torch.Tensor, torch.Tensor]:
    """Returns reward and discount `[G, K]` of arriving in states: a goal ends the episode, any other step costs 1."""
    discount = torch.sigmoid(-predictions.goal_logit)
    return -discount, discount


def lookahead(network: Network, latent: torch.Tensor, code: Code) -> torch.Tensor:
    """Returns action values `[G, K, 6]` of latent states `[G, K, D]` by one step of the model."""
    first = network.first_layer(latent, network.look(latent, code), code)
    after = network.step_all(latent, first, code)
    predictions = network.predict(after, network.look(after, code), code)
    reward, discount = outcome(predictions)
    qvalues = reward + discount * network.value(predictions.value_logits)
    return qvalues.unflatten(1, (-1, NUM_ACTIONS))


@torch.no_grad()
def lookahead_targets(
    network: Network, config: MuZeroConfig, batch: Batch, latent: torch.Tensor, code: Code
) -> Targets:
    """Returns values by tree backup, and policies by one step of lookahead, by the target network.

    Args:
      network: the target network.
      config: the policy's temperature, and the bound of values.
      batch: the experience.
      latent: `[G, S (L + 1), D]`, the batch's states, encoded by the target network.
      code: the batch's contexts, likewise.
    """
    with torch.autocast(latent.device.type, torch.bfloat16, enabled=_has_fast_bfloat16(latent.device)):
        qvalues = lookahead(network, latent, code).float().unflatten(1, batch.exists.shape[1:])
    policy = torch.softmax(qvalues / config.temperature, dim=-1)
    value = tree_backup_returns(qvalues, policy, batch.action, batch.at_goal, batch.exists)
    return Targets(value.clamp(-config.longest_value, 0.0), policy)


def _has_fast_bfloat16(device: torch.device) -> bool:
    """Returns whether the device has instructions for bfloat16; on a CPU, products then take a quarter of the time."""
    if device.type == "cpu":
        return torch.cpu._is_avx512_bf16_supported()
    return torch.cuda.is_bf16_supported()
