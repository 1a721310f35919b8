"""The folder of a running evaluation: in order whatever the order of arrival, and whole after a kill at any byte."""

from __future__ import annotations

import contextlib
import json
import pathlib
import resource
import shutil
from collections.abc import Iterator
from typing import Any

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies
from run_folders import FEW, Killed, files_of, results_of

from mazebench.errors import InputError, RunError
from mazebench.evaluation.chunk import Chunk, Result, poses_of, run_chunk
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.plan import Plan, make_plan
from mazebench.evaluation.store import Store
from mazebench.results.reading import load_result
from mazebench.results.records import Summary
from mazebench.storage.files import locked

NAMES = strategies.sampled_from(["result", "trajectory", "number", "success"]) | strategies.text(max_size=3)
JSON = strategies.none() | strategies.booleans() | strategies.integers() | strategies.floats(-1, 1) | strategies.text()


@pytest.fixture(scope="module")
def plan() -> Plan:
    return make_plan(eval_options("random", **FEW))


@pytest.fixture(scope="module")
def episodes(plan) -> list[Result]:
    """The results of all episodes of the plan, in its order."""
    chunk = Chunk(range(len(plan.trials)), num_envs=40, num_threads=0, keep=poses_of)
    return sorted(result for results in run_chunk(plan, chunk) for result in results)


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("unbroken") / "run"
    evaluate("random", out=folder, record=True, **FEW)
    return folder


@pytest.fixture(scope="module")
def summary(unbroken) -> Summary:
    return load_result(unbroken).summary


@contextlib.contextmanager
def files_of_at_most(num_bytes: int) -> Iterator[None]:
    """Lets no file of this process grow any further, as on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (num_bytes, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@hypothesis.settings(max_examples=12, deadline=None)
@hypothesis.given(strategies.integers(0, 2**32 - 1))
def test_a_journal_that_was_cut_anywhere_is_gone_on_with(plan, episodes, summary, unbroken, tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    folder, record = tmp_path_factory.getbasetemp() / "cut", bool(seed % 2)
    shutil.rmtree(folder, ignore_errors=True)
    order = rng.permutation(40).tolist()
    with Store(folder, plan, resume=False, record=record) as store:
        for index in order:
            store.append([episodes[index] if record else episodes[index]._replace(kept=())])
    journal = folder / "journal.jsonl"
    journal.write_bytes(journal.read_bytes()[: int(rng.integers(journal.stat().st_size + 1))] + b"\0" * (seed % 3))
    with Store(folder, plan, resume=True, record=record) as store:
        # What was appended last is lost.
        assert set(store.missing) == set(order[store.num_ended :])
        store.append([episodes[index] for index in store.missing])
        store.finish(store.records, summary)
    names = ["config.json", "episodes.jsonl"] + ["trajectories.npz"] * record
    assert results_of(folder) == {name: (unbroken / name).read_bytes() for name in names}


@pytest.mark.parametrize("record", [False, True])
def test_what_was_written_before_the_disk_is_full_is_kept(plan, episodes, summary, unbroken, tmp_path, record):
    ended = [each if record else each._replace(kept=()) for each in episodes]
    said = r"can't write there: File too large; what was written is kept, go on with --resume$"
    with Store(tmp_path, plan, resume=False, record=record) as store, files_of_at_most(12000 if record else 4000):
        for each in ended[:3]:
            store.append([each])
        with pytest.raises(RunError, match=said):
            store.append(ended[3:])
    with Store(tmp_path, plan, resume=True, record=record) as store:
        assert store.num_ended >= 3
        store.append([ended[index] for index in store.missing])
        with files_of_at_most(12000), pytest.raises(RunError, match=said):
            store.finish(store.records, summary)
        # No file that a reader would take for a whole one.
        assert set(files_of(tmp_path)) == {"config.json", "journal.jsonl"}
    evaluate("random", out=tmp_path, resume=True, **FEW)
    names = ["config.json", "episodes.jsonl"] + ["trajectories.npz"] * record
    assert results_of(tmp_path) == {name: (unbroken / name).read_bytes() for name in names}


def test_of_two_processes_that_begin_a_run_the_second_is_refused(plan, episodes, tmp_path):
    with Store(tmp_path, plan, resume=False, record=False) as first:
        with pytest.raises(InputError, match=r"holds a run already; go on with --resume or name another folder$"):
            Store(tmp_path, plan, resume=False, record=False)
        (tmp_path / "config.json").unlink()  # as if the first had just begun, or was killed then
        with pytest.raises(InputError, match=r"holds a run already; go on with --resume or name another folder$"):
            Store(tmp_path, plan, resume=False, record=False)
        first.append(episodes[:1])


def edited(line: str, key: str, value: Any) -> str:
    """A line of the journal with another trajectory, or another value of the result."""
    content = json.loads(line)
    (content if key == "trajectory" else content["result"])[key] = value
    return json.dumps(content)


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda line: "5", "expected another line 2, found "),
        (lambda line: "{}", "expected another line 2, found result: Field required"),
        (lambda line: edited(line, "trajectory", [[[1.0]], None]), "expected another line 2, found trajectory"),
        (lambda line: edited(line, "trajectory", [[[1, 2, 3]], None]), "found a trajectory of another length"),
        (lambda line: edited(line, "trajectory", [None, None]), "expected another line 2, found trajectory"),
        (lambda line: edited(line, "trajectory", [[[1, 2, 1e999]], None]), "expected another line 2, found trajectory"),
        (lambda line: edited(line, "level", 2), "expected another line 2, found result.level"),
        (lambda line: edited(line, "steps", -1), "expected another line 2, found result.steps"),
        (lambda line: edited(line, "path_length", 1e999), "expected another line 2, found result.path_length"),
        (lambda line: edited(line, "number", 99), "found one of 99, leg 1"),
        (lambda line: edited(line, "leg", 2), "found one of 0, leg 2"),
    ],
)
def test_a_line_that_is_no_result_of_the_run_is_refused(plan, episodes, tmp_path, edit, message):
    with Store(tmp_path, plan, resume=False, record=True) as store:
        store.append(episodes[:1])
    journal = tmp_path / "journal.jsonl"
    journal.write_text("\n" + edit(journal.read_text().strip()) + "\n")
    with pytest.raises(InputError, match=rf"journal\.jsonl: .*{message}"):
        Store(tmp_path, plan, resume=True, record=True)


@hypothesis.given(
    strategies.recursive(JSON, lambda inner: strategies.lists(inner) | strategies.dictionaries(NAMES, inner))
)
def test_any_other_line_is_refused(plan, tmp_path_factory, line):
    folder = tmp_path_factory.getbasetemp() / "lines"
    shutil.rmtree(folder, ignore_errors=True)
    with Store(folder, plan, resume=False, record=False):
        pass
    (folder / "journal.jsonl").write_text(json.dumps(line) + "\n")
    with pytest.raises(InputError, match="expected another line 1"):
        Store(folder, plan, resume=True, record=False)


def test_records_without_the_config_of_their_run_are_refused(plan, episodes, tmp_path):
    with Store(tmp_path, plan, resume=False, record=False) as store:
        store.append([episodes[0]._replace(kept=())])
    (tmp_path / "config.json").unlink()
    with pytest.raises(InputError, match=r"expected config\.json of the run in journal\.jsonl, found none"):
        Store(tmp_path, plan, resume=True, record=False)


def test_a_run_that_is_stopped_before_its_first_episode_ends_keeps_its_config(plan, tmp_path):
    with contextlib.suppress(Killed), Store(tmp_path, plan, resume=False, record=False):
        raise Killed
    assert (tmp_path / "config.json").exists()


def test_what_is_gone_is_not_said_to_be_kept(plan, episodes, tmp_path):
    with Store(tmp_path / "run", plan, resume=False, record=False) as store:
        store.append([each._replace(kept=()) for each in episodes])
        shutil.rmtree(tmp_path / "run")
        with pytest.raises(RunError, match=r"No such file or directory; its journal is gone$"):
            store.finish(store.records, None)


def test_a_config_that_is_none_is_refused(plan, tmp_path):
    (tmp_path / "config.json").write_text("[]")
    with pytest.raises(InputError, match=r"config\.json: expected the identity of a run, found list$"):
        Store(tmp_path, plan, resume=True, record=False)


@pytest.mark.parametrize("resume", [False, True])
def test_a_second_evaluation_in_the_folder_is_refused_while_the_first_writes(tmp_path, resume):
    with locked(tmp_path, "evaluation"):
        with pytest.raises(InputError, match="another evaluation writes there; end it, or name another folder"):
            evaluate("random", out=tmp_path, resume=resume, **FEW)
        assert not [*tmp_path.iterdir()]
    evaluate("random", out=tmp_path, resume=resume, **FEW)
