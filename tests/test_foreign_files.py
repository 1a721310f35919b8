"""Folders of somebody else: whatever they say, no command connects, tells a secret, or imports what lies in them."""

from __future__ import annotations

import csv
import io
import json
import pathlib
import re
import select
import shutil
import socket
from collections.abc import Callable, Iterator

import pytest
from faults import TRAIN
from hypothesis import example, given, settings
from hypothesis import strategies as st
from made_results import edit_summary, make_result, read_summary

from mazebench.errors import InputError
from mazebench.report import leaderboard
from mazebench.report.table import make_values
from mazebench.report.tables import Table
from mazebench.results.reading import EPISODES, SUMMARY, load_result
from mazebench.results.records import Summary

SECRET = "victims-secret-1234567890"
EVIL = "import pathlib\npathlib.Path('code_has_run').touch()\nclass X: pass\n"
EVAL = ["--distances", "2,4", "--episodes-per-distance", "1"]
QUICK = settings(max_examples=200, deadline=None, database=None)


@pytest.fixture
def listening(monkeypatch) -> Iterator[str]:
    """The address of a service on this machine to which nothing may connect."""
    monkeypatch.setenv("VICTIMS_KEY", SECRET)
    monkeypatch.setenv("OPENAI_API_KEY", SECRET)
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"http://127.0.0.1:{server.getsockname()[1]}/v1"
        assert not select.select([server], [], [], 0)[0], "something connected"


@pytest.fixture
def attacked(command, listening, tmp_path) -> Iterator[Callable[..., tuple[int, str]]]:
    """Runs a command in the folder of an attacker; gives its status and what it says."""
    (tmp_path / "evil.py").write_text(EVIL)
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\nbackend: module://evil\n")

    def run(*words: object) -> tuple[int, str]:
        status, output, errors = command(*map(str, words))
        assert SECRET not in output + errors
        assert (output + errors).replace("\n", "").isprintable()
        assert not pathlib.Path("code_has_run").exists()
        return status, output + errors

    yield run
    assert not any(SECRET.encode() in path.read_bytes() for path in tmp_path.rglob("*") if path.is_file())


def render(*more: object) -> tuple[object, ...]:
    return ("render", "--results", "bad", "--episode", "0", "--view", "map", "--out", "film.png", *more)


@pytest.fixture
def bad(tmp_path) -> pathlib.Path:
    folder = make_result(tmp_path / "bad", "llm", num_mazes=1)
    (folder / "config.json").write_text("{}")
    return folder


class TestRender:
    @pytest.mark.parametrize("name", ["base_url", "key_variable", "replay", "timeout", "token_limit"])
    def test_what_can_not_change_results_is_taken_from_no_file(self, attacked, bad, listening, name):
        values = {"base_url": listening, "key_variable": "VICTIMS_KEY", "replay": ".", "timeout": 1, "token_limit": 9}
        edit_summary(bad, config={"model": "m", name: values[name]})
        assert attacked(*render())[0] == 2
        status, said = attacked(*render("--set", "replay=bad"))
        assert status == 2
        assert "expected in config what may change results: model, mode, see, temperature, max_tokens, extra" in said
        assert f"found '{name}'" in said

    def test_a_service_is_named_on_the_command_line(self, attacked, bad):
        edit_summary(bad, config={"model": "m", "max_decisions": 1})
        status, said = attacked(*render())
        assert (status, "expected --set model=NAME and --set base_url=http" in said) == (2, True)

    def test_an_agent_of_a_module_is_imported_only_if_it_is_named(self, attacked, bad):
        edit_summary(bad, agent="evil:X")
        status, said = attacked(*render())
        assert (status, "its agent is 'evil:X'; name it by --agent, found none named" in said) == (2, True)
        assert attacked(*render("--agent", "planner"))[0] == 2

    def test_a_config_of_another_form_is_named(self, attacked, bad):
        edit_summary(bad, agent="planner")
        (bad / "config.json").write_text("[]")
        status, said = attacked(*render())
        assert (status, "config.json: expected the identity of a run, found list" in said) == (2, True)

    def test_a_named_module_is_imported(self, command, bad, tmp_path):
        (tmp_path / "mine.py").write_text("from mazebench_agents.planner import ClosedLoopPlanner as Mine\n")
        edit_summary(bad, agent="mine:Mine")
        assert command(*render("--agent", "mine:Mine"))[0] == 0
        assert (tmp_path / "film.png").exists()


def test_readers_of_results_connect_to_nobody_and_import_nothing(attacked, bad, listening):
    shutil.copytree(bad, "suite/evil-X/part")
    suite = {"suite": "tracks", "parts": ["part"], "benchmark": "paper", "benchmark_manifest_sha256": "", "seed": 0}
    suite |= {"agents": ["evil:X"], "folders": {"evil:X": "evil-X"}}
    pathlib.Path("suite/suite.json").write_text(json.dumps(suite))
    for folder in ("bad", "suite/evil-X/part"):
        config = {"model": "m", "base_url": listening, "key_variable": "VICTIMS_KEY"}
        origin = read_summary(pathlib.Path(folder))["provenance"] | {"agent_class": "evil:X"}
        edit_summary(pathlib.Path(folder), agent="evil:X", config=config, provenance=origin)
    assert attacked("compare", "bad", "bad")[0] == 0
    assert attacked("compare", "suite", "suite")[0] == 0
    assert attacked("report", "bad", "suite", "--out", "report")[0] == 0
    with pytest.raises(SystemExit):
        leaderboard.main("suite", "bad", "page.md")


def test_runs_that_are_gone_on_with_connect_to_nobody_and_import_nothing(attacked, tmp_path, listening):
    assert attacked("eval", "--agent", "random", *EVAL, "--out", "run")[0] == 0
    (tmp_path / "run" / "summary.json").unlink()
    path = tmp_path / "run" / "config.json"
    config = json.loads(path.read_text())
    path.write_text(json.dumps(config | {"agent": "evil:X", "config": {"model": "m", "base_url": listening}}))
    status, said = attacked("eval", "--agent", "random", *EVAL, "--out", "run", "--resume")
    assert (status, "holds another run: its agent is evil:X, this one's random" in said) == (2, True)
    suite = {"suite": "quick", "parts": ["local-13"], "benchmark": "paper", "benchmark_manifest_sha256": "", "seed": 0}
    (tmp_path / "suite").mkdir()
    text = json.dumps(suite | {"agents": ["evil:X"], "folders": {"evil:X": "evil-X"}})
    (tmp_path / "suite" / "suite.json").write_text(text)
    assert attacked("eval", "--agent", "random", "--suite", "quick", "--out", "suite", "--resume")[0] == 2
    (tmp_path / "training" / "checkpoints").mkdir(parents=True)
    (tmp_path / "training" / "config.json").write_text(json.dumps({"agent": "evil:X", "overrides": {"x": listening}}))
    assert attacked(*TRAIN, "--env-steps", "800", "--out", "training", "--resume")[0] == 2


def test_a_checkpoint_names_no_code(attacked, tmp_path):
    import torch  # takes a while
    from mazebench_agents.common.checkpoint import AGENT_FILE, save_checkpoint

    metadata = {"agent": "evil:X", "config": {"module": "evil"}, "context_size": 13}
    save_checkpoint(tmp_path / AGENT_FILE, {"x": torch.zeros(1)}, metadata)
    status, said = attacked("eval", "--agent", "mah", "--checkpoint", ".", *EVAL, "--out", "run")
    assert (status, "expected a checkpoint of agent 'mah', found one of 'evil:X'" in said) == (2, True)


class TestNames:
    """Names in files may be any text; none reaches a terminal, a page or a spreadsheet as a command."""

    NASTY = "\x1b[31m=1+1\u202e\u2066"

    def test_nothing_that_does_not_print_is_shown(self, attacked, tmp_path):
        folder = make_result(tmp_path / f"a{self.NASTY}", "x", num_mazes=1)
        summary = read_summary(folder)
        for name in ("command", "machine", "python", "packages"):
            value = summary["provenance"][name]
            nasty = [self.NASTY] if isinstance(value, list) else self.NASTY
            summary["provenance"][name] = {self.NASTY: self.NASTY} if isinstance(value, dict) else nasty
        config = {self.NASTY: [self.NASTY, {self.NASTY: 1}]}
        edit_summary(folder, agent=f"={self.NASTY}", config=config, provenance=summary["provenance"])
        assert attacked("compare", folder, folder)[0] == 0
        assert attacked("report", tmp_path, "--out", "report")[0] == 0
        for path in pathlib.Path("report").rglob("*"):
            if path.suffix in (".html", ".md", ".csv", ".tex"):
                text = path.read_text()
                assert not {"\x1b", "\u202e", "\u2066"} & set(text)
                assert not any(cell.startswith("=") for line in text.splitlines() for cell in line.split(","))

    def test_a_result_with_any_text_in_any_place_or_cut_is_read_or_refused_in_one_line(self, tmp_path):
        folder = make_result(tmp_path / "x", "x", num_mazes=1, record=False)
        whole = {name: (folder / name).read_bytes() for name in (SUMMARY, EPISODES)}

        @QUICK
        @given(st.sampled_from(sorted(whole)), st.text(st.characters(), max_size=20), st.data())
        def check(file, text, data):
            place = data.draw(st.sampled_from([match.span() for match in re.finditer(rb'"[^"]*"', whole[file])]))
            content = whole[file][: place[0]] + json.dumps(text).encode() + whole[file][place[1] :]
            for name in whole:
                (folder / name).write_bytes(content if name == file else whole[name])
            if data.draw(st.booleans()):
                (folder / file).write_bytes(content[: data.draw(st.integers(0, len(content)))])
            try:
                result = load_result(folder)
                said = result.summary.who + "".join(record.maze + record.split for record in result.records)
            except InputError as error:
                said = str(error)
            assert said.isprintable()

        check()

    def test_any_name_prints_and_is_no_formula(self, tmp_path):
        summary = read_summary(make_result(tmp_path / "x", "x", num_mazes=1, record=False))

        @QUICK
        @given(st.text(st.characters(exclude_categories=("Cs",)), min_size=1, max_size=20))
        @example("=cmd|' /C calc'!A0")
        @example("\t=1")
        def check(name):
            found = Summary.model_validate_json(json.dumps(summary | {"agent": name, "config": {name: name}}))
            assert found.who.isprintable()
            assert Summary.model_validate(found.model_dump()) == found
            line = {"metric": "spl", "row": "1", "column": found.who, "source": "measured", "episodes": 1, "value": 1}
            text = Table("t", "t", "", "row", make_values([line], ["1"])).to_files()[".csv"]
            assert [*csv.reader(io.StringIO(text))][1][2][0] not in "=+-@"

        check()
