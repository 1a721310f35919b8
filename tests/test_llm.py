"""The agents that plan in words: prompt and grammar, services that fail, answers that are kept, people, the ladder.

`python tests/test_llm.py` rewrites the golden prompt and picture.
"""

from __future__ import annotations

import collections
import http.server
import io
import json
import pathlib
import re
import threading
from collections.abc import Callable, Iterator

import cv2
import numpy as np
import pytest
from mazebench_agents.llm import scripted
from mazebench_agents.llm.decision import read_decision
from mazebench_agents.llm.situation import Situation, picture, prompt
from run_folders import records_of, results_of, summary_of

from mazebench.agent import Agent, AgentConfig
from mazebench.errors import InputError, RunError, UnplayableError
from mazebench.evaluation.checked_agent import AgentError
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.plan import make_plan

GOLDEN = pathlib.Path(__file__).parent / "golden"
FLIPPED = {"distances": (8,), "episodes_per_distance": 1, "map_flip": 0.1}  # 20 episodes on wrong maps, without a lidar
NEAR = {
    "task": "rebuilt",
    "level": 2,
    "split": "dev",
    "distances": range(15, 19),
    "episodes_per_maze": 1,
}  # 11 of a track


def situation(told: bool = True) -> Situation:
    """A moment in a ring of 7 x 7 cells: the door (1, 3) on the way is closed, the one at (3, 2) is open."""
    walls = np.ones((7, 7), dtype=bool)
    walls[[1, 5], 1:6] = walls[1:6, [1, 5]] = False
    walls[3, 2:5] = False
    walls[3, 2] = True
    seen = np.zeros((7, 7), dtype=np.int8)
    seen[0:4, 0:4] = np.where(walls[0:4, 0:4], 1, -1)
    seen[1, 3], seen[3, 2] = 1, -1
    said = ("GO (1, 5): stopped, a wall is in the way at (1, 3)",)
    return Situation(walls, (1, 1), (1, 5), seen, (2.5, 5.4, 0.1), 0.62, 4, told, seed=0, number=2, decisions=said)


class TestPrompt:
    def test_the_prompt_is_the_golden_one(self):
        assert prompt(situation()) + "\n" == (GOLDEN / "prompt.txt").read_text(encoding="utf-8")

    def test_who_must_notice_is_shown_the_same_but_for_the_list(self):
        told, noticing = (prompt(situation(each)).split("\n\n") for each in (True, False))
        assert [part for part in told if part not in noticing] == [
            "SEEN, DIFFERENT FROM THE MAP\nClosed: (1, 3)\nOpen: (3, 2)"
        ]

    def test_the_picture_is_the_golden_one(self):
        golden = cv2.imread(str(GOLDEN / "prompt.png"))[..., ::-1].astype(int)
        assert np.abs(picture(situation()) - golden).max() <= 1

    @pytest.mark.parametrize(
        ("script", "decision"),
        [
            ("bfs", "GO (1, 5)"),
            ("told", "GO (1, 1) (3, 1) (3, 5) (1, 5)"),
            ("hope", "GO (1, 1) (3, 1) (3, 5) (1, 5)"),
        ],
    )
    def test_scripts_revise_what_they_read_or_nothing(self, script, decision):
        assert scripted.SCRIPTS[script](prompt(situation())) == decision


@pytest.mark.parametrize(
    ("answer", "route"),
    [
        ("GO (1, 3)", ((1, 1), (1, 2), (1, 3))),
        ("First I go east.\n**GO (1, 2) (3, 2)**", ((1, 1), (1, 2), (2, 2), (3, 2))),
        ("go south 2, east", ((1, 1), (2, 1), (3, 1), (3, 2))),
        ("GO (1, 3)\nNo.\nMy answer: GO (2,1)\nI hope it will go well.", ((1, 1), (2, 1))),
        ("GO (1, 2) (1, 1)", ((1, 1), (1, 2), (1, 1))),
        ("wait", ()),
    ],
)
def test_the_last_command_is_read(answer, route):
    decision = read_decision(answer, (1, 1), 5)
    assert (decision.route, decision.fault) == (route, "")


@pytest.mark.parametrize(
    ("answer", "fault"),
    [
        ("", "no line with GO or WAIT"),
        ("I would let it go around.", "no line with GO or WAIT"),
        ("GO", "it names no other cell"),
        ("GO (1, 1)", "it names no other cell"),
        ("GO (2, 2)", r"\(2, 2\) is not in the row or column of \(1, 1\)"),
        ("GO north 3", r"\(-2, 1\) is outside of the map"),
        ("GO (1, 9999)", r"\(1, 9999\) is outside of the map"),
        ("GO (1, 99999999999999)", r"\(1, 99999999999999\) is outside of the map"),
    ],
)
def test_what_is_wrong_with_a_command_is_said(answer, fault):
    decision = read_decision(answer, (1, 1), 5)
    assert decision.route == ()
    assert re.match(fault, decision.fault)


class Service:
    """A local service that answers as the script `hope` does; `fault` says by the number of a request what fails."""

    def __init__(self, fault: Callable[[int], object] = lambda number: None):
        self.counts: collections.Counter = collections.Counter()
        self.keys, self.closed, lock = set(), threading.Event(), threading.Lock()
        service = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def log_message(self, *words):
                pass

            def do_POST(self):
                body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                with lock:
                    service.counts["requests"] += 1
                    wrong = fault(service.counts["requests"])
                    service.counts["answers" if wrong is None else wrong] += 1
                service.keys.add(self.headers["Authorization"])
                content = b"{}" if wrong == "no choices" else b"<html>" if wrong == "no JSON" else service.answer(body)
                if wrong == "too late":
                    service.closed.wait(30)
                self.send_response(wrong if isinstance(wrong, int) else 200)
                self.send_header("Retry-After", "0")
                self.send_header("Content-Length", str(len(content) + 9 * (wrong == "cut")))
                self.end_headers()
                self.wfile.write(content)

        quiet = {"request_queue_size": 64, "handle_error": lambda *of_client: None}
        server_class = type("Server", (http.server.ThreadingHTTPServer,), quiet)
        self.server = server_class(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True).start()
        self.config = {"model": "m", "base_url": f"http://127.0.0.1:{self.server.server_address[1]}/v1", "backoff": 0}

    def answer(self, body: dict) -> bytes:
        message = {"role": "assistant", "content": scripted.hope(body["messages"][1]["content"])}
        usage = {"prompt_tokens": 100, "completion_tokens": 10}
        choice = {"message": message, "finish_reason": "stop"}
        return json.dumps({"model": body["model"] + "-2026", "choices": [choice], "usage": usage}).encode()

    def close(self) -> None:
        self.closed.set()
        self.server.shutdown()
        self.server.server_close()


@pytest.fixture
def serve() -> Iterator[Callable[..., Service]]:
    services: list[Service] = []

    def start(*arguments) -> Service:
        services.append(Service(*arguments))
        return services[-1]

    yield start
    for each in services:
        each.close()


def answers_of(folder: pathlib.Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "answers.jsonl").read_text().splitlines()]


def driven(folder: pathlib.Path) -> list[tuple]:
    """What came of the episodes, but for the seconds that answers took."""
    return [(each["steps"], each["path_length"], each["notes"] | {"seconds": 0}) for each in records_of(folder)]


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory) -> pathlib.Path:
    folder, service = tmp_path_factory.mktemp("runs") / "unbroken", Service()
    evaluate("llm", out=folder, overrides=service.config, **FLIPPED)
    service.close()
    return folder


class TestService:
    def test_answers_and_what_they_cost_are_part_of_the_result(self, unbroken):
        answers, notes = answers_of(unbroken), [each["notes"] for each in records_of(unbroken)]
        assert len({each["prompt"] for each in answers}) == sum(each["decisions"] for each in notes) > 20
        told = {(each["model"], each["input_tokens"], each["finish_reason"]) for each in answers}
        assert told == {("m-2026", 100, "stop")}
        assert sum(each["output_tokens"] for each in notes) == 10 * len(answers)
        assert summary_of(unbroken)["config"] == {"model": "m"}

    def test_faults_are_tried_again_and_change_nothing(self, unbroken, tmp_path, serve, monkeypatch):
        monkeypatch.setenv("MY_KEY", "secret\n")
        faults = dict(enumerate((429, 500, "no JSON", "no choices", "cut", "too late"), start=2))
        service = serve(faults.get)
        overrides = service.config | {"timeout": 2, "key_variable": "MY_KEY"}
        evaluate("llm", out=tmp_path / "run", overrides=overrides, **FLIPPED)
        assert driven(tmp_path / "run") == driven(unbroken)
        assert all(service.counts[fault] == 1 for fault in faults.values())
        assert service.keys == {"Bearer secret"}

    @pytest.mark.parametrize("last", [0, 5, 25])
    def test_a_service_that_dies_costs_nothing_that_was_answered(self, unbroken, tmp_path, serve, last):
        dying = serve(lambda number: 503 if number > last else None)
        with pytest.raises(RunError, match=r"no answer in 2 tries, the last one HTTP 503: .*go on with --resume$"):
            evaluate("llm", out=tmp_path, overrides=dying.config | {"max_retries": 1}, **FLIPPED)
        other = serve()  # at another address
        evaluate("llm", out=tmp_path, overrides=other.config, resume=True, num_envs=7, **FLIPPED)
        assert driven(tmp_path) == driven(unbroken)
        assert (dying.counts["answers"], other.counts["answers"]) == (last, len(answers_of(unbroken)) - last)

    def test_a_refusal_ends_the_run_at_once(self, tmp_path, serve):
        service = serve(lambda number: 401)
        with pytest.raises(RunError, match=r"/v1/chat/completions: HTTP 401: .*nothing is lost"):
            evaluate("llm", out=tmp_path, overrides=service.config | {"concurrency": 1}, **FLIPPED)
        assert service.counts["requests"] < 20

    def test_a_run_ends_at_its_limit_of_tokens_and_goes_on_with_a_higher_one(self, unbroken, tmp_path, serve):
        config = serve().config | {"concurrency": 1}
        with pytest.raises(RunError, match="spent 550 tokens of token_limit 500"):
            evaluate("llm", out=tmp_path, overrides=config | {"token_limit": 500}, **FLIPPED)
        evaluate("llm", out=tmp_path, overrides=config, resume=True, **FLIPPED)
        assert driven(tmp_path) == driven(unbroken)

    def test_another_model_is_another_run(self, unbroken):
        with pytest.raises(InputError, match="holds another run: its config is"):
            evaluate("llm", out=unbroken, overrides={"model": "other"}, resume=True, **FLIPPED)


class TestReplay:
    @pytest.mark.parametrize(
        "how", [{"num_envs": 3}, pytest.param({"workers": 2}, marks=pytest.mark.slow)], ids=["here", "workers"]
    )
    def test_a_replay_asks_nobody_and_gives_the_same_bytes(self, unbroken, tmp_path, how):
        evaluate("llm", out=tmp_path, overrides={"model": "m", "replay": str(unbroken.parent)}, **how, **FLIPPED)
        again, before = results_of(tmp_path), results_of(unbroken)
        assert sorted(again.pop("answers.jsonl").splitlines()) == sorted(before.pop("answers.jsonl").splitlines())
        assert again == before

    @pytest.mark.parametrize(
        ("changed", "said"),
        [
            ({"mode": "told"}, "expected the answer in step 1, found none"),
            ({"replay": "nowhere"}, r"nowhere: expected answers\.jsonl to replay in it or below, found none"),
        ],
    )
    def test_a_prompt_without_an_answer_is_refused(self, unbroken, tmp_path, changed, said):
        with pytest.raises(InputError, match=said):
            evaluate("llm", out=tmp_path / "x", overrides={"model": "m", "replay": str(unbroken)} | changed, **FLIPPED)
        assert not (tmp_path / "x").exists()

    def test_a_line_that_was_cut_is_asked_again(self, unbroken, tmp_path, serve):
        service, lines = serve(), (unbroken / "answers.jsonl").read_bytes()
        for name in ("config.json", "answers.jsonl"):
            (tmp_path / name).write_bytes((unbroken / name).read_bytes())
        (tmp_path / "answers.jsonl").write_bytes(lines[:-20])
        evaluate("llm", out=tmp_path, overrides=service.config, resume=True, **FLIPPED)
        assert driven(tmp_path) == driven(unbroken)
        assert service.counts["answers"] == 1


class TestPerson:
    OPTIONS = FLIPPED | {"map_flip": 0.0, "num_envs": 1, "overrides": {"model": "person:someone"}}

    def test_a_person_types_routes_and_goes_on_later(self, tmp_path, monkeypatch, capsys):
        for typed, said in (("hello\ngo north 1\n", r"the input ended; .*--resume"), ("wait\n", "the input ended")):
            monkeypatch.setattr("sys.stdin", io.StringIO(typed))
            with pytest.raises(RunError, match=said):
                evaluate("llm", out=tmp_path, resume=True, **self.OPTIONS)
        assert [each["text"] for each in answers_of(tmp_path)] == ["hello", "go north 1", "wait"]
        assert all(each["seconds"] > 0 for each in answers_of(tmp_path))
        shown = capsys.readouterr().out
        assert "- hello: not done, no line with GO or WAIT was found" in shown
        assert cv2.imread(str(tmp_path / "picture.png")).shape == (12 * 13, 12 * 13, 3)

    def test_episodes_side_by_side_are_refused(self, tmp_path):
        with pytest.raises(InputError, match="expected --num-envs 1 for a person, found 20 episodes side by side"):
            evaluate("llm", out=tmp_path, **self.OPTIONS | {"num_envs": 256})


class TestAgents:
    def test_who_takes_in_what_was_seen_is_better_than_who_never_revises(self):
        found = {name: evaluate(name, **NEAR).overall for name in ("llm-bfs", "llm-hope")}
        assert found["llm-hope"].success_rate == 1.0
        assert found["llm-bfs"].success_rate < 0.6
        assert found["llm-bfs"].on_time["1.25"] < found["llm-hope"].on_time["1.25"]

    @pytest.mark.parametrize(
        ("agent", "options", "error", "said"),
        [
            ("llm", {}, InputError, "expected --set model=NAME and --set base_url=http"),
            ("llm", {"overrides": {"model": "m", "extra": "[1]"}}, InputError, "expected extra as a JSON object"),
            ("llm", {"overrides": {"colour": "red"}}, InputError, "unknown config key 'colour'"),
            ("random", {"overrides": {"mode": "told"}}, InputError, "has no config in evaluations, found --set mode"),
            ("llm-hope", {"task": "rough"}, UnplayableError, "expected the building's 31 x 31 cells, found 62 x 62"),
        ],
    )
    def test_what_can_not_be_played_is_refused(self, tmp_path, agent, options, error, said):
        with pytest.raises(error, match=said):
            evaluate(agent, out=tmp_path / "run", **options)
        assert not (tmp_path / "run").exists()

    def test_a_frozen_episode_of_each_maze_is_drawn_in_turn(self):
        every, some = (
            make_plan(eval_options("random", "rebuilt", episodes_per_maze=number)).trials for number in (5, 1)
        )
        assert list(some) == [every[5 * maze + maze % 5] for maze in range(48)]

    def test_the_command_shows_what_is_asked(self, command, tmp_path):
        words = ("--track", "rebuilt", "--level", "2", "--split", "dev", "--episode", "5", "--out", "shown")
        first, second = (command("prompt", *words, "--decision", number) for number in ("1", "2"))
        assert (first[0], second[0]) == (0, 0)
        assert "LAST DECISIONS\n- none yet\n" in first[1]
        assert "LAST DECISIONS\n- GO (" in second[1]
        assert (tmp_path / "shown" / "prompt.txt").read_text() == second[1]
        assert cv2.imread(str(tmp_path / "shown" / "picture.png")).shape == (372, 372, 3)


class Failing(Agent):
    """Keeps a file in the folder of its results, and then fails."""

    eval_config = AgentConfig()

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None, config=None, folder=None):
        agent = cls()
        agent.folder = folder
        return agent

    def act(self, inputs, state, explore=False):
        (self.folder / "kept.txt").touch()
        raise ValueError


def test_a_run_in_which_an_agent_kept_a_file_can_be_gone_on_with(tmp_path):
    for _ in range(2):
        with pytest.raises(AgentError):
            evaluate(Failing, out=tmp_path, resume=True, distances=(1,), episodes_per_distance=1)
    assert {path.name for path in tmp_path.iterdir()} == {"config.json", "journal.jsonl", "kept.txt"}


if __name__ == "__main__":
    (GOLDEN / "prompt.txt").write_text(prompt(situation()) + "\n", encoding="utf-8")
    cv2.imwrite(str(GOLDEN / "prompt.png"), picture(situation())[..., ::-1])
