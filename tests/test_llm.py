"""The agents that plan in words: prompt and grammar, services that fail, answers that are kept, people, the ladder.

`python tests/test_llm.py` rewrites the golden prompt and picture.
"""

from __future__ import annotations

import base64
import collections
import contextlib
import hashlib
import http.server
import io
import json
import pathlib
import re
import sys
import threading
from collections.abc import Callable, Iterator

import cv2
import numpy as np
import pydantic
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mazebench_agents.llm import scripted
from mazebench_agents.llm.answer import Answer
from mazebench_agents.llm.budget import Budget, Tries
from mazebench_agents.llm.config import LLMConfig
from mazebench_agents.llm.decision import CUT, FILTERED, WITHOUT_TEXT, read_decision
from mazebench_agents.llm.pictures import to_png
from mazebench_agents.llm.service import NoAnswerError, answer_of
from mazebench_agents.llm.service import Service as Client
from mazebench_agents.llm.situation import Situation, View, key_of, picture, prompt, question
from openai.types.chat import ChatCompletionContentPartParam, ChatCompletionSystemMessageParam
from run_folders import files_of, records_of, results_of, summary_of

from mazebench.agent import Agent, AgentConfig
from mazebench.errors import InputError, RunError, UnplayableError
from mazebench.evaluation.checked_agent import AgentError
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.plan import make_plan
from mazebench.maps.colors import GOAL, START, to_bytes
from mazebench.storage.json_files import to_line

GOLDEN = pathlib.Path(__file__).parent / "golden"
FLIPPED = {"distances": (8,), "episodes_per_distance": 1, "map_flip": 0.1}  # 20 episodes on wrong maps, without a lidar
NEAR = {
    "task": "rebuilt",
    "level": 2,
    "split": "dev",
    "distances": range(15, 19),
    "episodes_per_maze": 1,
}  # 11 of a track
ONE = {"task": "rebuilt", "level": 2, "kinds": ("dfs",), "num_mazes": 1, "size": 13, "distances": (15,)}
ONE |= {"split": "dev", "episodes_per_distance": 1}  # one episode
SECRET = "sk-SECRET-1234567890"
QUICK = settings(max_examples=200, deadline=None, database=None)


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
        ("GO 2 south, 1 east", ((1, 1), (2, 1), (3, 1), (3, 2))),
        ("GO South: 2 cells, then east=1", ((1, 1), (2, 1), (3, 1), (3, 2))),
        ("<answer>GO south2 east +1</answer>", ((1, 1), (2, 1), (3, 1), (3, 2))),
        ("<think>I GO (3, 1)</think>\nGO (1, 2)", ((1, 1), (1, 2))),
        ("\n" * 200_000 + "#.#\n---\n" * 20_000 + "GO (1, 2)", ((1, 1), (1, 2))),  # in no time
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
        ("GO north three", "'three' can't be read"),
        ("GO south -2", "'-2' can't be read"),
        ("GO south 1.5", "'.5' can't be read"),
        ("GO southeast 2", "'southeast' can't be read"),
        ("GO south 2 3", "'3' can't be read"),
        ("WAIT 5", "it waits for one step, not 5"),
        ("\n" * 200_000, "no line with GO or WAIT"),
        ("GO (1, 99999999999999)", r"\(1, 99999999999999\) is outside of the map"),
    ],
)
def test_what_is_wrong_with_a_command_is_said(answer, fault):
    decision = read_decision(answer, (1, 1), 5)
    assert decision.route == ()
    assert re.match(fault, decision.fault)


@pytest.mark.parametrize(
    ("answer", "reason", "flaw"),
    [
        ("", "stop", WITHOUT_TEXT),
        ("<think>GO (1, 2)</think>", "stop", WITHOUT_TEXT),
        ("", "length", CUT),
        ("<think>One way is GO (1, 2) but that may be bl", "length", CUT),
        ("<think>One way is\nGO (1, 2)\n", "", CUT),
        ("I think of\nGO (1, 2)", "length", CUT),
        ("GO (1, 2)\nor", "MAX_TOKENS", CUT),
        ("GO (1", "content_filter", FILTERED),
        ("GO (1, 2)", "stop", ""),
        ("So:\nGO (1, 2)\n", "length", ""),  # a whole line
    ],
)
def test_an_answer_that_ends_before_its_decision_is_none(answer, reason, flaw):
    decision = read_decision(answer, (1, 1), 5, reason)
    assert (decision.flaw, decision.route) == (flaw, () if flaw else ((1, 1), (1, 2)))


def reply(content: object, reason: str = "stop", **others: object) -> bytes:
    """What a service replies with an answer."""
    return json.dumps({"choices": [{"message": {"content": content}, "finish_reason": reason}]} | others).encode()


class TestReplies:
    @pytest.mark.parametrize(
        ("body", "text"),
        [
            (reply("WAIT"), "WAIT"),
            (reply(None), ""),
            (b'{"choices": [{"message": {"refusal": "I can not."}}]}', "I can not."),
            (reply([{"type": "thinking", "thinking": []}, {"type": "text", "text": "WA"}, "IT"]), "WAIT"),
            (b'{"choices": [{"message": {"content": "\\ud83d WAIT"}}]}', "\ufffd WAIT"),
        ],
    )
    def test_the_text_of_an_answer_is_found(self, body, text):
        answer = answer_of(body)
        assert answer.text == text
        assert Answer.model_validate_json(answer.model_dump_json()) == answer

    @pytest.mark.parametrize("tokens", [-5, 1.0e300, "x", None, [], 2**60])
    def test_counts_that_can_not_be_are_none(self, tokens):
        assert answer_of(reply("WAIT", usage={"prompt_tokens": tokens, "completion_tokens": 7})).input_tokens == 0

    @pytest.mark.parametrize(
        ("body", "said"),
        [
            (b'{"error": {"message": "Rate limit exceeded"}}', "Rate limit exceeded$"),
            (b'{"error": "overloaded"}', "overloaded$"),
            (b'{"choices": [], "usage": null}', r'\{"choices": \[\], "usage": null\}$'),
            (b'{"choices": [{"text": "WAIT"}]}', "WAIT"),
            (b"data: {}", "data: {}$"),
            (b"<html>Log in", "<html>Log in$"),
            (b"[" * 100_000, r"\[\["),
        ],
    )
    def test_without_an_answer_what_the_service_says_is_told(self, body, said):
        with pytest.raises(NoAnswerError, match=f"^HTTP 200 without an answer: .*{said}"):
            answer_of(body)

    _VALUES = st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(st.sampled_from(("choices", "message", "content", "text", "usage", "error")), inner)
        ),
        max_leaves=8,
    )

    @QUICK
    @given(
        st.binary(max_size=60)
        | st.builds(lambda value: json.dumps(value).encode(), _VALUES)
        | st.builds(reply, _VALUES)
    )
    def test_any_reply_is_an_answer_or_none(self, body):
        with contextlib.suppress(NoAnswerError):
            answer = answer_of(body)
            assert Answer.model_validate_json(to_line(answer.model_dump())) == answer

    @QUICK
    @given(st.text(max_size=200), st.text(max_size=10))
    @example("GO " * 30_000, "")
    def test_any_text_is_a_route_on_the_map_or_a_fault(self, text, reason):
        route, said = (decision := read_decision(text, (1, 1), 5, reason)).route, decision.said
        assert all(0 <= row < 5 and 0 <= column < 5 for row, column in route)
        assert len(said) < 120
        assert not (route and decision.fault)

    def test_any_status_ends_in_one_line_without_the_key(self, serve, monkeypatch):
        monkeypatch.setenv("OPENAI_API_KEY", SECRET)
        service = serve()
        client = Client(config := LLMConfig(**service.config | {"max_retries": 0}))

        @QUICK
        @given(st.integers(200, 599), st.text(max_size=20) | st.just("{}"), st.booleans())
        @example(401, "Incorrect API key provided: Bearer {}", True)
        def ask(status, text, is_json):
            text = text.replace("{}", SECRET)
            service.status = status
            service.reply = json.dumps({"error": {"message": text}} if is_json else [text]).encode()
            with pytest.raises(RunError) as caught:
                ask_service(config, client)
            assert SECRET not in str(caught.value)
            assert len(str(caught.value)) < 500

        ask()


class TestSecrets:
    @pytest.mark.parametrize(
        ("values", "said"),
        [
            ({"key_variable": SECRET}, "expected key_variable as the name of a variable that is set"),
            ({"key_variable": "AKIASECRET1234567890"}, "expected key_variable as the name of a variable that is set"),
            ({"extra": json.dumps({"api_key": SECRET})}, "found a field 'api_key'"),
            ({"extra": json.dumps({"extra_headers": [{"X-Auth-Token": [SECRET]}]})}, "found a field 'X-Auth-Token'"),
            ({"extra": "{api_key: " + SECRET}, "expected extra as a JSON object"),
            ({"base_url": f"http://me:{SECRET}@host/v1"}, "expected base_url without a user, a password or a query"),
            ({"base_url": f"http://me:{SECRET}/v1"}, "expected base_url like"),
            ({"base_url": f"https://host/v1?key={SECRET}"}, "expected base_url without a user, a password or a query"),
        ],
    )
    def test_a_secret_in_the_config_is_refused_and_not_shown(self, command, tmp_path, values, said):
        words = [word for name, value in values.items() for word in ("--set", f"{name}={value}")]
        status, _, errors = command("eval", "--agent", "llm", "--set", "model=m", *words, "--out", "run")
        assert (status, errors.count("\n")) == (2, 1)
        assert said in errors
        assert "SECRET" not in errors
        assert not (tmp_path / "run").exists()

    @pytest.mark.parametrize(
        "fields", [{"max_completion_tokens": 9}, {"stop": ["\n\n"]}, {"prompt_cache_key": "mazes"}]
    )
    def test_other_fields_of_a_request_are_taken(self, fields):
        assert LLMConfig(extra=json.dumps(fields)).sampling.items() >= fields.items()

    @pytest.mark.parametrize("key", [f"{SECRET}\n{SECRET}", f"{SECRET}\r", f"\u200b{SECRET}", f"{SECRET} x"])
    def test_a_key_that_no_header_can_hold_is_refused_before_the_first_request(self, tmp_path, serve, monkeypatch, key):
        monkeypatch.setenv("OPENAI_API_KEY", f"{key}x")
        service = serve()
        with pytest.raises(InputError, match=r"^OPENAI_API_KEY: expected .* ASCII characters, found U\+") as caught:
            evaluate("llm", out=tmp_path / "run", overrides=service.config, **ONE)
        assert SECRET not in str(caught.value)
        assert service.counts["requests"] == 0
        assert not (tmp_path / "run").exists()

    def test_the_key_is_in_no_file_whatever_the_service_repeats(self, tmp_path, serve, monkeypatch):
        monkeypatch.setenv("OPENAI_API_KEY", SECRET)
        service = serve()
        service.reply = reply(f"Bearer {SECRET}", f"as {SECRET}", model=SECRET)
        evaluate("llm", out=tmp_path, overrides=service.config | {"max_decisions": 1}, **ONE)
        (answer,) = answers_of(tmp_path)
        assert (answer["text"], answer["finish_reason"], answer["model"]) == ("Bearer ***", "as ***", "***")
        assert not any(SECRET.encode() in content for content in files_of(tmp_path).values())

    def test_a_key_in_another_value_is_refused(self, monkeypatch):
        monkeypatch.setenv("OPENAI_API_KEY", SECRET)
        with pytest.raises(InputError, match=r"^expected the key only in OPENAI_API_KEY, found it in base_url too$"):
            ask_service(LLMConfig(model="m", base_url=f"https://host/{SECRET}/v1"))


def ask_service(config: LLMConfig, client: Client | None = None) -> Answer:
    return (client or Client(config)).ask([], Tries(Budget(config, []), []))


class Service:
    """A local service that answers as the script `hope` does; `fault` says by the number of a request what fails."""

    def __init__(self, fault: Callable[[int], object] = lambda number: None):
        self.counts: collections.Counter = collections.Counter()
        self.keys, self.closed, lock = set(), threading.Event(), threading.Lock()
        self.headers: dict[str, str] = {}  # of the last request
        self.bodies: list[dict] = []
        self.status, self.reply = 200, b""  # a reply other than the script's
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
                service.headers = dict(self.headers)
                service.bodies.append(body)
                content = b"{}" if wrong == "no choices" else b"<html>" if wrong == "no JSON" else b""
                content = content or service.reply or service.answer(body)
                if wrong == "too late":
                    service.closed.wait(30)
                self.send_response(wrong if isinstance(wrong, int) else service.status)
                self.send_header("Retry-After", "0")
                self.send_header("Content-Length", str(len(content) + 9 * (wrong == "cut")))
                if wrong == 301:
                    self.send_header("Location", "https://elsewhere/v2/chat/completions")
                self.end_headers()
                for number in range(100 if wrong == "drips" else 0):
                    self.wfile.write(content[number : number + 1])
                    service.closed.wait(0.05)
                self.wfile.write(content)

        quiet = {"request_queue_size": 64, "handle_error": lambda *of_client: None}
        server_class = type("Server", (http.server.ThreadingHTTPServer,), quiet)
        self.server = server_class(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True).start()
        self.config = {"model": "m", "base_url": f"http://127.0.0.1:{self.server.server_address[1]}/v1"}

    def answer(self, body: dict) -> bytes:
        message = {"role": "assistant", "content": scripted.hope(self.read(body["messages"]))}
        usage = {"prompt_tokens": 100, "completion_tokens": 10}
        choice = {"message": message, "finish_reason": "stop"}
        return json.dumps({"model": body["model"] + "-2026", "choices": [choice], "usage": usage}).encode()

    def read(self, messages: list[dict]) -> str:
        """Returns the situation in words."""
        return messages[1]["content"]

    def close(self) -> None:
        self.closed.set()
        self.server.shutdown()
        self.server.server_close()


class Seeing(Service):
    """A service that reads no word of a question: it drives by the picture of the map alone."""

    def read(self, messages: list[dict]) -> str:
        pydantic.TypeAdapter(ChatCompletionSystemMessageParam).validate_python(messages[0])
        assert messages[1].keys() == {"role", "content"}
        for part in messages[1]["content"]:
            pydantic.TypeAdapter(ChatCompletionContentPartParam).validate_python(part, strict=True)
        return prompt(shown_in(pictures_of(messages)[0]))


def pictures_of(messages: list[dict]) -> list[bytes]:
    """Returns the pictures of a question."""
    urls = [part["image_url"]["url"] for part in messages[1]["content"] if part["type"] == "image_url"]
    assert all(url.startswith("data:image/png;base64,") for url in urls)
    return [base64.b64decode(url.partition(",")[2], validate=True) for url in urls]


def shown_in(png: bytes, pixels: int = 32) -> Situation:
    """Returns what the picture of a map shows, here with 13 cells a side."""
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    size = len(image) // pixels
    cells = image.reshape(size, pixels, size, pixels, 3).swapaxes(1, 2)

    def cells_with(*color: int) -> np.ndarray:
        return (cells == color).all(axis=-1).sum(axis=(2, 3))

    edges = np.concatenate([cells[:, :, [2, -3], 2:-2], cells[:, :, 2:-2, [2, -3]].swapaxes(2, 3)], axis=2)
    walls = np.median(edges.mean(axis=-1), axis=(2, 3)) < 128
    start, goal = (cells_with(*to_bytes(color)) for color in (START, GOAL))
    ends = [divmod(int(found.argmax()), size) if found.any() else None for found in (start, goal)]
    seen = (cells_with(255, 150, 0) > 0).astype(np.int8) - (cells_with(110, 190, 255) > 0)
    robot = cv2.distanceTransform((image == (230, 0, 230)).all(axis=-1).astype(np.uint8), cv2.DIST_L2, 5)
    y, x = np.unravel_index(robot.argmax(), robot.shape)
    return Situation(walls, *ends, seen, (x / pixels, size - y / pixels, 0.0), 1.0, 1, False, 0)


@pytest.fixture
def serve() -> Iterator[Callable[..., Service]]:
    services: list[Service] = []

    def start(*arguments, kind: type[Service] = Service) -> Service:
        services.append(kind(*arguments))
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
        config = serve().config
        said = r"spent [1-9],?\d+ tokens of token_limit 7,000, and the next answer may take [45],\d+ "
        with pytest.raises(RunError, match=said):
            evaluate("llm", out=tmp_path, overrides=config | {"token_limit": 7000}, **FLIPPED)
        assert 7000 - 6000 < 110 * len(answers_of(tmp_path)) <= 7000
        evaluate("llm", out=tmp_path, overrides=config, resume=True, **FLIPPED)
        assert driven(tmp_path) == driven(unbroken)

    def test_a_service_that_tells_no_usage_is_said_and_its_answers_count_as_the_most(self, tmp_path, serve, remarks):
        service = serve()
        service.reply = reply("WAIT")
        config = service.config | {"max_decisions": 3, "token_limit": 9000}
        with pytest.raises(RunError, match="of token_limit 9,000"):
            evaluate("llm", out=tmp_path, overrides=config, **ONE)
        assert remarks() == [
            "llm: 1 episodes, some 10 questions each (the scripts' mean; at most 3): some 3 questions, "
            "0.002 million tokens in, at most 0.012 million out",
            "agent 'llm': the service tells no usage of an answer, which counts as the most that it may take",
        ]
        assert len(answers_of(tmp_path)) == 1

    def test_answers_without_a_decision_are_said_once_and_counted(self, command, serve):
        service = serve()
        service.reply = reply(None, usage={"prompt_tokens": 100, "completion_tokens": 10})
        words = [word for item in service.config.items() for word in ("--set", "{}={}".format(*item))]
        task = ["--track", "rebuilt", "--level", "2", "--kinds", "dfs", "--num-mazes", "1", "--size", "13"]
        task += ["--distances", "15", "--episodes-per-distance", "1", "--split", "dev"]
        run = ("eval", "--agent", "llm", *words, "--set", "max_decisions=3", *task)
        status, output, errors = command(*run, "--out", "run")
        assert status == 0
        assert errors.count("an answer holds no text (finish_reason 'stop'), so it is no decision") == 1
        assert "decisions 3, not done 3, input tokens 300, output tokens 30, without text 3\n" in output
        assert summary_of(pathlib.Path("run"))["counts"]["without_text"] == 3

    def test_workers_are_refused_since_tokens_are_counted_in_one_process(self, tmp_path):
        overrides = {"model": "m", "base_url": "http://127.0.0.1:9/v1"}
        with pytest.raises(InputError, match="agent 'llm': expected no --workers with this config, found 2"):
            evaluate("llm", out=tmp_path / "run", workers=2, overrides=overrides, **ONE)

    def test_another_model_is_another_run(self, unbroken):
        with pytest.raises(InputError, match="holds another run: its config is"):
            evaluate("llm", out=unbroken, overrides={"model": "other"}, resume=True, **FLIPPED)

    def test_what_tries_without_a_reply_may_have_taken_counts(self, tmp_path, serve):
        service = serve({1: "cut"}.get)
        config = service.config | {"max_decisions": 1, "max_tokens": 100}
        evaluate("llm", out=tmp_path / "run", overrides=config, **ONE)
        (answer,) = answers_of(tmp_path / "run")
        assert 1000 < answer["lost_tokens"] - 100 < 4000  # the bytes of the question
        other = serve({1: "cut"}.get)
        limit = {"token_limit": 2 * answer["lost_tokens"] - 1}
        with pytest.raises(RunError, match=r"spent [\d,]+ tokens of token_limit .*, and the next answer may take"):
            evaluate("llm", out=tmp_path / "short", overrides=config | other.config | limit, **ONE)
        assert other.counts["requests"] == 1

    def test_a_reply_has_a_largest_size_and_a_longest_time(self, serve, monkeypatch):
        service = serve({1: "drips"}.get)
        service.reply = reply("WAIT " * 100)
        config = LLMConfig(**service.config | {"max_retries": 0, "timeout": 2})
        with pytest.raises(RunError, match=r"ReadTimeout: expected a reply within 2 s"):
            ask_service(config)
        monkeypatch.setattr("mazebench_agents.llm.service._LARGEST_REPLY", 400)
        with pytest.raises(RunError, match="RemoteProtocolError: expected at most 400 bytes, found more"):
            ask_service(config)

    def test_a_service_that_moved_is_not_followed_but_named(self, serve):
        service = serve({1: 301}.get)
        service.reply = b"moved"
        with pytest.raises(RunError, match="HTTP 301: it has moved; give base_url=https://elsewhere/v2;"):
            ask_service(LLMConfig(**service.config))
        assert service.counts["requests"] == 1

    def test_variables_of_the_client_are_not_read(self, serve, monkeypatch):
        for name in ("API_KEY", "ADMIN_KEY", "ORG_ID", "PROJECT_ID"):
            monkeypatch.setenv(f"OPENAI_{name}", SECRET)
        monkeypatch.setenv("OPENAI_BASE_URL", "http://127.0.0.1:9/v1")
        monkeypatch.setenv("OPENAI_CUSTOM_HEADERS", f"X-Other: {SECRET}")
        monkeypatch.setenv("MY_KEY", "mine-1")
        monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")  # which this machine's own services need not
        service = serve()
        service.reply = reply("WAIT")
        ask_service(LLMConfig(**service.config | {"key_variable": "MY_KEY"}))
        assert service.headers.pop("Authorization") == "Bearer mine-1"
        own = {"Host", "Accept", "Accept-Encoding", "Connection", "User-Agent", "Content-Type", "Content-Length"}
        assert {name.title() for name in service.headers} == own
        assert SECRET not in str(service.headers)
        with pytest.raises(RunError, match=r"^http://far\.invalid/v1/chat/completions through the environment's proxy"):
            ask_service(LLMConfig(model="m", base_url="http://far.invalid/v1", max_retries=0, key_variable="MY_KEY"))

    def test_without_the_client_one_line_says_what_brings_it(self, tmp_path, monkeypatch):
        monkeypatch.setitem(sys.modules, "openai", None)
        monkeypatch.delitem(sys.modules, "mazebench_agents.llm.service")
        said = r"^agent 'llm': a service needs the package openai, which the extra \[llm\] brings"
        with pytest.raises(InputError, match=said):
            evaluate("llm", overrides={"model": "m", "base_url": "http://127.0.0.1:9/v1"}, **ONE)


class TestPictures:
    def test_the_picture_shows_what_the_words_say(self):
        told = situation(told=False)
        shown = shown_in(to_png(picture(told, shows_seen=True)))
        seen = told.seen.copy()
        assert (shown.walls == told.walls).all()
        assert (shown.start, shown.goal, shown.here) == (told.start, told.goal, told.here)
        assert (shown.seen == seen).all()
        assert not shown_in(to_png(picture(told))).seen.any()

    @pytest.mark.parametrize("see", ["map", "both"])
    def test_who_reads_the_picture_drives_as_who_reads_the_words(self, unbroken, tmp_path, serve, see):
        service = serve(kind=Seeing)
        evaluate("llm", out=tmp_path / "run", overrides=service.config | {"see": see}, **FLIPPED)
        assert driven(tmp_path / "run") == driven(unbroken)
        texts = [body["messages"][1]["content"][0]["text"] for body in service.bodies]
        assert all(("SEEN SO FAR" in text) == (see == "both") for text in texts)

        # Each picture is kept once, and a replay asks nobody.
        kept = sorted((tmp_path / "run" / "pictures").iterdir())
        assert [hashlib.sha256(path.read_bytes()).hexdigest() for path in kept] == [path.stem for path in kept]
        named = {name for answer in answers_of(tmp_path / "run") for name in answer["pictures"]}
        assert named == {path.stem for path in kept}
        replay = {"model": "m", "see": see, "replay": str(tmp_path / "run")}
        evaluate("llm", out=tmp_path / "again", overrides=replay, **FLIPPED)
        again, before = results_of(tmp_path / "again"), results_of(tmp_path / "run")
        assert sorted(again.pop("answers.jsonl").splitlines()) == sorted(before.pop("answers.jsonl").splitlines())
        assert again == before

    def test_what_the_camera_sees_takes_the_place_of_what_was_seen(self, tmp_path, serve):
        service = serve()
        service.reply = reply("GO north\nGO south", usage={"prompt_tokens": 900, "completion_tokens": 10})
        config = service.config | {"see": "egocentric", "max_decisions": 6}
        evaluate("llm", out=tmp_path, overrides=config, **ONE)
        assert summary_of(tmp_path)["task"]["sensors"] == ["lidar", "egocentric"]
        numbers = []
        for body in service.bodies:
            text = body["messages"][1]["content"][0]["text"]
            drawn, *views = pictures_of(body["messages"])
            assert not shown_in(drawn).seen.any()
            row, column = map(int, re.search(r"The robot is in cell \((\d+), (\d+)\)", text).groups())
            x, y, _ = shown_in(drawn).pose
            assert max(abs(x - column - 0.5), abs(13 - y - row - 0.5)) < 0.6
            assert "SEEN" not in text
            assert "small square" not in text
            sizes = {cv2.imdecode(np.frombuffer(view, np.uint8), cv2.IMREAD_COLOR).shape for view in views}
            assert sizes == {(180, 768, 3)}
            numbers.append(len(views))
            assert len(re.findall("^Picture ", text, re.M)) == len(views)
        assert numbers[0] == 1
        assert max(numbers) > 1

    def test_egocentric_tells_nothing_of_what_the_lidar_saw_and_the_pose_of_the_words(self, command):
        view = View(np.zeros((180, 768, 3), np.uint8), 4, (1, 2), "")
        one = situation(told=False)._replace(see="egocentric", views=(view,))
        assert question(one) == question(one._replace(seen=np.zeros_like(one.seen)))
        assert key_of(one, {}) != key_of(one._replace(views=(view._replace(picture=view.picture + 1),)), {})
        # Where the pose is lost, too.
        words = ("--track", "adrift", "--level", "2", "--split", "dev", "--episode", "7", "--decision", "2")
        told = [
            re.search(r"NOW\n.*\n.*\nStep", command("prompt", *words, "--set", f"see={see}")[1])[0]
            for see in ("text", "egocentric")
        ]
        assert told[0] == told[1]

    def test_a_narrow_camera_is_shown_as_it_is(self, tmp_path, command):
        words = ("--track", "rebuilt", "--level", "2", "--split", "dev", "--sensors", "lidar,egocentric")
        status, shown, _ = command("prompt", *words, "--set", "see=egocentric")
        assert status == 0
        assert re.search(r"^Picture 2: now, from cell \(\d+, \d+\), which faces \w+\.$", shown, re.M)
        assert cv2.imread(str(tmp_path / "prompt" / "picture-2.png")).shape == (64, 64, 3)


class TestCost:
    RUN = ("eval", "--agent", "llm", "--set", "model=m", "--set", "base_url=http://127.0.0.1:9/v1")

    def test_a_dry_run_says_what_a_suite_may_cost_and_asks_nobody(self, command, tmp_path):
        status, output, errors = command(*self.RUN, "--suite", "llm-dev", "--set", "price=2.5,10", "--dry-run")
        assert (status, output) == (0, "")
        (line,) = errors.splitlines()
        assert re.fullmatch(
            r"mazebench: llm: 192 episodes, some 10 questions each \(the scripts' mean; at most 30\): "
            r"some 1,920 questions, [\d.]+ million tokens in, at most 7\.9 million out; "
            r"some \d\.\d\d dollars in, at most 78\.64 out",
            line,
        )
        assert not [*tmp_path.iterdir()]

    def test_a_dry_run_of_another_agent_costs_nothing(self, command, tmp_path):
        status, _, errors = command("eval", "--agent", "planner", "--dry-run", "--out", "run")
        assert (status, errors) == (0, "mazebench: planner: 1,500 episodes, which cost nothing\n")
        assert not [*tmp_path.iterdir()]

    def test_the_summary_has_the_money_of_all_tokens(self, tmp_path, serve):
        service = serve()
        evaluate("llm", out=tmp_path, overrides=service.config | {"price": "2000,30000"}, **ONE)
        counts = summary_of(tmp_path)["counts"]
        assert counts["dollars"] == pytest.approx(counts["decisions"] * (100 * 2000 + 10 * 30000) / 1e6)

    @pytest.mark.parametrize("price", ["1", "1,2,3", "-1,2", "a,b", "nan,1"])
    def test_a_price_is_two_numbers(self, price):
        with pytest.raises(InputError, match="expected price=IN,OUT, dollars per million tokens"):
            LLMConfig(price=price)


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

    @pytest.mark.parametrize(("cut", "line"), [(slice(60, None), 1), (slice(None, -20), None)])
    def test_a_damaged_line_is_named(self, unbroken, tmp_path, cut, line):
        lines = (unbroken / "answers.jsonl").read_bytes()
        (tmp_path / "answers.jsonl").write_bytes(lines[cut])
        line = line or lines.count(b"\n")
        with pytest.raises(InputError, match=rf"expected the answer in step \d+, found line {line} of .*jsonl damaged"):
            evaluate("llm", overrides={"model": "m", "replay": str(tmp_path)}, **FLIPPED)

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
        assert cv2.imread(str(tmp_path / "picture.png")).shape == (32 * 13, 32 * 13, 3)

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
            ("llm-hope", {"overrides": {"see": "map"}}, InputError, "expected see=text of a script, which reads words"),
            ("llm", {"overrides": {"see": "film"}}, InputError, "unknown see 'film'; available: both, egocentric, map"),
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
        assert cv2.imread(str(tmp_path / "shown" / "picture.png")).shape == (744, 744, 3)


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
