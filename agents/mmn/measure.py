"""The speed of the search, compared with mctx's if that is installed.

The search's network is a stand-in of MMN's size. Its transition has other weights in each row, as a hypermodel's has.
"""

from __future__ import annotations

import importlib.util
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch

from mazebench.errors import RunError

from ..common import kernels
from ..common.actor import one_torch_thread
from ..muzero.search import gumbel_muzero_policy, muzero_policy
from .compiled import stand_in as compiled
from .compiled.model import CompiledModel
from .compiled.parts import Heads, layer_of

NUM_ACTIONS = 6
LATENT = 64
HIDDEN = 128
NUM_BINS = 65  # of values in [-64, 0]
NUM_SIMULATIONS = 16
_HEADS = ("head_1", "head_2", "outputs")
_CASES = (("gumbel", 1), ("gumbel", 64), ("gumbel", 256), ("puct", 64))  # policy, roots
_ROUNDS = 7  # in which the search and mctx are measured by turns
# XLA would use a thread a core.
_ONE_THREAD = {
    "JAX_PLATFORMS": "cpu",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "OMP_NUM_THREADS": "1",
}


def weight_shapes(batch_size: int) -> dict[str, tuple[int, ...]]:
    """Returns the shapes of the network's weights; the transition's layers have weights of their own in each row."""
    return {
        "transition_1": (batch_size, LATENT + NUM_ACTIONS, LATENT),
        "transition_2": (batch_size, LATENT, LATENT),
        "head_1": (LATENT, HIDDEN),
        "head_2": (HIDDEN, HIDDEN),
        "outputs": (HIDDEN, NUM_ACTIONS + NUM_BINS + 1),  # policy, value, end
    }


def random_weights(batch_size: int) -> dict[str, np.ndarray]:
    """Returns the same random weights each time."""
    rng = np.random.default_rng(0)
    return {
        name: (rng.normal(size=shape) / shape[-2] ** 0.5).astype(np.float32)
        for name, shape in weight_shapes(batch_size).items()
    }


def stand_in(batch_size: int) -> CompiledModel:
    """Returns the stand-in as kernels."""
    # Tensors are aligned in memory, as those of a network are.
    arrays = {name: torch.tensor(array).numpy() for name, array in random_weights(batch_size).items()}
    heads = (torch.from_numpy(arrays[name]).T for name in _HEADS)
    model = compiled.StandIn(
        arrays["transition_1"],
        arrays["transition_2"],
        NUM_BINS,
        Heads(*(layer_of(weight, torch.zeros(len(weight))) for weight in heads)),
    )
    return CompiledModel(model, 0, compiled.step, compiled.arrive)


def search_table(seconds: float) -> dict[str, list[dict[str, Any]]]:
    """Returns the simulations per second of CPU time by title, in about `seconds` for each figure."""
    with one_torch_thread(), kernels.one_thread(), _mctx() as mctx:
        rows = [_row(policy, batch_size, seconds / _ROUNDS, mctx) for policy, batch_size in _CASES]
    return {f"tree search, {NUM_SIMULATIONS} simulations, one thread": rows}


def _row(policy: str, batch_size: int, seconds: float, mctx: Callable[..., float] | None) -> dict[str, Any]:
    step = _search_step(policy, batch_size)
    sides = {"sims/s": lambda: rate(step, batch_size, seconds)}
    if mctx is not None:
        sides["mctx sims/s"] = lambda: mctx(policy, batch_size, seconds)
    rounds = [{name: side() for name, side in sides.items()} for _ in range(_ROUNDS)]
    row: dict[str, Any] = {"what": f"{policy}, {batch_size} root{'s' * (batch_size > 1)}"}
    row |= {name: round(statistics.median(each[name] for each in rounds)) for name in sides}
    for name in list(sides)[1:]:
        row[f"/ {name.removesuffix(' sims/s')}"] = statistics.median(each["sims/s"] / each[name] for each in rounds)
    return row


def rate(step: Callable[[], Any], batch_size: int, seconds: float) -> float:
    """Returns simulations per second of CPU time, where `step` does those of a whole search."""
    step()
    count, begin = 0, time.process_time()
    while (elapsed := time.process_time() - begin) < seconds:
        step()
        count += 1
    return count * batch_size * NUM_SIMULATIONS / elapsed


def _search_step(policy: str, batch_size: int) -> Callable[[], Any]:
    """Returns a function that searches."""
    model, rng = stand_in(batch_size), np.random.default_rng(0)
    root = model.root(torch.from_numpy(rng.normal(size=(batch_size, LATENT)).astype(np.float32)))
    gumbel = rng.gumbel(size=root.prior_logits.shape).astype(np.float32)
    dirichlet = rng.dirichlet(np.full(NUM_ACTIONS, 0.3), batch_size).astype(np.float32)

    def search() -> None:
        if policy == "gumbel":
            gumbel_muzero_policy(root, model, NUM_SIMULATIONS, gumbel)
        else:
            muzero_policy(root, model, NUM_SIMULATIONS, dirichlet, gumbel)

    return search


@contextmanager
def _mctx() -> Iterator[Callable[[str, int, float], float] | None]:
    """Yields a function that measures mctx's rate in another process; None if mctx is not installed."""
    if importlib.util.find_spec("mctx") is None:
        yield None
        return
    command = [sys.executable, "-m", f"{__package__}.measure_mctx"]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, env={**os.environ, **_ONE_THREAD}, text=True, **pipes) as process:
        questions, answers = process.stdin, process.stdout
        assert questions is not None
        assert answers is not None

        def ask(policy: str, batch_size: int, seconds: float) -> float:
            questions.write(json.dumps([policy, batch_size, seconds]) + "\n")
            questions.flush()
            if not (line := answers.readline()):
                raise RunError(f"the process that measures mctx ended with exit status {process.wait()}")
            return json.loads(line)

        try:
            yield ask
        finally:
            questions.close()
