"""The tables of results in README.md and docs, and the records that they are made from."""

from __future__ import annotations

import collections
import hashlib
import json
import re
import shlex
import tarfile

import pandas as pd
import pytest

import mazebench
from benchmarks.equal_code import is_one_code
from benchmarks.results.kept import Kept, keep, read_kept
from benchmarks.results.results_tables import PAGES, RECORDS, ROOT, with_tables
from mazebench.agent_loading import load_agent_class
from mazebench.results.reading import load_result

DOCS = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")))
COMMAND = re.compile(r"mazebench (eval|train|bench)|python (-m (benchmarks|mazebench)|docs/examples)|make results")
GENERATED = re.compile(r"<!-- (table|leaderboard begins)\b.*?<!-- (end of table|leaderboard ends) -->", re.DOTALL)
# Tables of numbers that were chosen, not measured, by their first line.
CHOSEN = ("| map | repository",)


@pytest.fixture(scope="module")
def kept() -> Kept:
    return read_kept(RECORDS)


@pytest.mark.parametrize("page", PAGES)
def test_the_tables_of_a_page_are_those_of_the_records(page, kept):
    text = (ROOT / page).read_text(encoding="utf-8")
    assert "<!-- table: " in text
    assert with_tables(page, text, kept) == text, "`make results` writes them"


@pytest.fixture(scope="module")
def archives() -> dict[str, tuple[str, set[str]]]:
    """The hash of all that each archive of evaluations holds, and the agents in it, by the archive's name."""
    found = {}
    for path in sorted(RECORDS.glob("*.tar.xz")):
        contents, agents = {}, set()
        with tarfile.open(path) as archive:
            for member in archive:
                content = archive.extractfile(member).read()
                if member.name.endswith(".json"):
                    values = json.loads(content)
                    agents |= {values["agent"]} if "agent" in values else set()
                    content = json.dumps(values, sort_keys=True).encode()
                contents[member.name] = content
        digest = hashlib.sha256()
        for name in sorted(contents):
            digest.update(name.encode() + b"\0" + hashlib.sha256(contents[name]).digest())
        found[path.name.removesuffix(".tar.xz")] = digest.hexdigest(), agents
    return found


def test_kept_evaluations_are_what_they_were(archives):
    kept = json.loads((ROOT / "tests" / "golden" / "records.json").read_text())
    assert {name: archives[name][0] for name in kept} == kept


def test_every_agent_of_a_record_can_be_loaded(archives, monkeypatch):
    pytest.importorskip("sb3_contrib")
    monkeypatch.syspath_prepend(ROOT / "docs" / "examples")
    for agent in set.union(*(agents for _, agents in archives.values())):
        load_agent_class(agent)


def test_columns_of_the_ceilings_are_of_code_that_was_shown_equal():
    played = collections.defaultdict(set)
    for name in ("tracks", "tracks-no-map", "tracks-true-pose", "ceilings"):
        with tarfile.open(RECORDS / f"{name}.tar.xz") as archive:
            summaries = [json.load(archive.extractfile(each)) for each in archive if each.name.endswith("summary.json")]
        for summary in summaries:
            if summary["agent"].startswith("navigator"):
                played[summary["agent"]].add(summary["provenance"]["agent_code_sha256"])
    assert set(played) == {"navigator", "navigator-told"}
    assert is_one_code(played)


class TestReproduction:
    """docs/reproduce.md names all that was published."""

    PAGE = (ROOT / "docs" / "reproduce.md").read_text(encoding="utf-8")

    def test_every_archive_has_a_command_and_its_minutes(self, archives):
        [commands] = re.findall(r"^## Commands\n(.*?)^## ", self.PAGE, re.DOTALL | re.MULTILINE)
        training = {path.name.removesuffix(".tar.xz") for path in (RECORDS / "training").glob("*.tar.xz")}
        named = set(re.findall(r"(?:results|runs)/([\w-]+)", commands))
        assert {*archives, *training} - named == set()
        timed = set(re.findall(r"^\| `([\w/-]+)` \|.*\| \d+ \| \d+ \|$", commands, re.MULTILINE))
        assert timed == {*archives, *(f"training/{name}" for name in training)}

    @pytest.mark.parametrize("page", [page for page in DOCS if page != PAGES[-1]])
    def test_every_table_of_the_pages_is_listed(self, page):
        text = (ROOT / page).read_text(encoding="utf-8")
        for name in re.findall(r"^<!-- table: (.+) -->$", text, re.MULTILINE):
            assert re.search(rf"\| `{name}` \|$", self.PAGE, re.MULTILINE), name

    def test_every_checkpoint_that_ships_has_its_hash_and_recipe(self):
        shipped = {
            path.name: hashlib.sha256(path.read_bytes()).hexdigest()
            for path in (ROOT / "assets" / "checkpoints").glob("*.safetensors")
        }
        stated = re.findall(r"^([0-9a-f]{64})  assets/checkpoints/(.+)$", self.PAGE, re.MULTILINE)
        assert {name: digest for digest, name in stated} == shipped
        section = self.PAGE.partition("\n## Checkpoints that ship\n")[2]
        for name in shipped:
            [row] = re.findall(rf"^\| `{name.removesuffix('.safetensors')}` \|.*", section, re.MULTILINE)
            assert COMMAND.search(row) or "(agents/" in row

    def test_the_options_of_its_scripts_exist(self):
        for line in self.PAGE.replace("\\\n", " ").splitlines():
            if line.startswith("python docs/"):
                _, script, *words = shlex.split(line, comments=True)
                source = (ROOT / script).read_text(encoding="utf-8")
                assert all(f'"{word}"' in source for word in words if word.startswith("--")), line


@pytest.mark.parametrize("page", DOCS)
def test_a_table_of_numbers_has_a_command_in_its_section(page):
    text = GENERATED.sub("", (ROOT / page).read_text(encoding="utf-8"))
    for section in re.split(r"^#+ ", text, flags=re.MULTILINE):
        for table in re.findall(r"(?:^\|.*\n)+", section, re.MULTILINE):
            numbers = re.findall(r"(?<=\| )[-+]?\d*\.\d+[^|a-z]*(?= \|)", table)
            if len(numbers) > 5 and not table.startswith(CHOSEN):
                assert COMMAND.search(section), table


def test_an_archive_holds_the_evaluation_that_was_kept(tmp_path):
    mazebench.evaluate("random", out=tmp_path / "run", distances=(1,), episodes_per_distance=1)
    path = keep(tmp_path / "run", tmp_path / "records")
    with tarfile.open(path) as archive:
        archive.extractall(tmp_path / "unpacked", filter="data")
    found, expected = load_result(tmp_path / "unpacked" / "run"), load_result(tmp_path / "run")
    assert (found.summary, found.records) == (expected.summary, expected.records)
    assert keep(tmp_path / "run", tmp_path / "again").read_bytes() == path.read_bytes()


def test_a_training_run_is_kept_with_its_last_checkpoint(tmp_path):
    run = tmp_path / "mine" / "seed-3"
    for steps in ("000000000100", "000000000200"):
        (run / "checkpoints" / steps).mkdir(parents=True)
        (run / "checkpoints" / steps / "agent.safetensors").write_text(steps)
        (run / "checkpoints" / steps / "replay.npz").write_text("large")
    (run / "config.json").write_text('{"seed": 3}')
    (run / "metrics.jsonl").write_text('{"env_steps": 100, "success_rate_2": 0.5}\n')
    path = keep(run.parent, tmp_path / "records")
    assert path == tmp_path / "records" / "training" / "mine.tar.xz"
    with tarfile.open(path) as archive:
        inside = ("config.json", "metrics.jsonl", "checkpoints/000000000200/agent.safetensors")
        assert archive.getnames() == [f"mine/seed-3/{name}" for name in inside]


def test_success_rates_are_of_milestones_that_all_runs_reached():
    first = ({"env_steps": 200_064, "success_rate_2": 0.1}, {"env_steps": 300_000, "td_loss": 1.0})
    last = ({"env_steps": 6_600_000, "success_rate_2": 0.8}, {"env_steps": 6_648_448, "success_rate_2": 0.9})
    runs = [pd.DataFrame([*first, *last]), pd.DataFrame(first[:1]).assign(success_rate_2=0.3)]
    both, alone = (Kept(pd.DataFrame(), {}, {"a": some}).success_rates("a", 2) for some in (runs, runs[:1]))
    assert both.to_dict("index") == {0.2: {"mean": 0.2, "min": 0.1, "max": 0.3}}
    assert alone["mean"].to_dict() == {0.2: 0.1, 6.6: 0.9}
