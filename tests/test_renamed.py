"""Agents that got other names: what was written under the old ones is read under the new, or refused by name."""

import json
import shutil

import pytest
import torch
from mazebench_agents.common.checkpoint import AGENT_FILE, load_agent, save_checkpoint
from mazebench_agents.mmn import MMN
from run_folders import FEW, files_of

from mazebench.agent_loading import load_agent_class
from mazebench.errors import InputError
from mazebench.evaluation.evaluate import evaluate
from mazebench.report.results import read_results
from mazebench.results.comparison import compare_folders
from mazebench.results.reading import load_result
from mazebench.training.run_folder import RunFolder

FORMER = {  # by former name: what it is called now, its classes, a part of its config
    "mmn": ("belief-planner", "mazebench_agents.mmn.belief.agent:MMN", {"num_distances": 2, "channels": 32}),
    "mmn-paper": ("mmn", "mazebench_agents.mmn.mmn:MMNPaper", {"rows": True, "hypermodel": True}),
}


@pytest.fixture(scope="module")
def planner_run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "planner"
    evaluate("planner", folder, **FEW)
    return folder


def written_by(agent, planner_run, folder):
    """Makes `folder` hold the results of an agent of before the rename."""
    shutil.copytree(planner_run, folder)
    for name in ("episodes.jsonl", "summary.json", "config.json"):
        text = (folder / name).read_text()
        (folder / name).write_text(text.replace('"agent":"planner"', f'"agent":"{agent}"'))
    for name in ("summary.json", "config.json"):
        content = json.loads((folder / name).read_text()) | {"agent": agent}
        where = content["provenance"] if name == "summary.json" else content
        where |= {"agent_code_sha256": None}
        if name == "summary.json":
            where["agent_class"] = FORMER[agent][1]
        (folder / name).write_text(json.dumps(content))
    return folder


@pytest.mark.parametrize("agent", FORMER)
def test_a_finished_result_appears_under_the_present_name(agent, planner_run, tmp_path):
    folder = written_by(agent, planner_run, tmp_path / agent)
    before, now = files_of(folder), FORMER[agent][0]
    result = load_result(folder)
    assert {result.summary.agent, *(record.agent for record in result.records)} == {now}
    assert [each.label for each in read_results([folder])] == [now]
    assert compare_folders(folder, planner_run).title.startswith(f"A is {now} in ")
    assert files_of(folder) == before


@pytest.mark.parametrize("agent", FORMER)
def test_an_unfinished_result_is_refused_by_name(agent, planner_run, tmp_path):
    folder = written_by(agent, planner_run, tmp_path / agent)
    for name in ("summary.json", "episodes.jsonl"):
        (folder / name).unlink()
    (folder / "journal.jsonl").write_text("{}\n")
    before, now = files_of(folder), FORMER[agent][0]
    with pytest.raises(InputError, match=f"found one of '{now}', written before the rename, that is not finished"):
        load_result(folder)
    with pytest.raises(InputError, match=f"holds a run of '{now}', written before the rename; name another folder"):
        evaluate("mmn", folder, resume=True, **FEW)
    assert files_of(folder) == before


def test_the_former_name_of_the_agent_after_the_paper_is_refused():
    with pytest.raises(InputError, match=r"^agent 'mmn-paper' is now 'mmn'$"):
        load_agent_class("mmn-paper")


@pytest.mark.parametrize("agent", FORMER)
@pytest.mark.parametrize("loaded_as", ["mmn", "belief-planner"])
def test_a_checkpoint_is_refused_by_the_keys_of_its_config(agent, loaded_as, tmp_path):
    now, _, config = FORMER[agent]
    save_checkpoint(tmp_path / AGENT_FILE, {"x": torch.zeros(1)}, {"agent": agent, "config": config})
    with pytest.raises(InputError, match=f"agent '{loaded_as}', found one of '{now}', written before the rename"):
        load_agent(tmp_path / AGENT_FILE, loaded_as, MMN.default_config)


@pytest.mark.parametrize("agent", FORMER)
def test_a_training_run_is_refused_by_name(agent, tmp_path):
    now, _, config = FORMER[agent]
    (tmp_path / "config.json").write_text(json.dumps({"agent": agent, "agent_config": config}))
    with (
        RunFolder(tmp_path) as run,
        pytest.raises(InputError, match=f"holds a run of '{now}', written before the rename; name another folder"),
    ):
        run.check_config({"agent": "mmn", "agent_config": {}})
