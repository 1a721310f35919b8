"""`mazebench prompt`."""

from __future__ import annotations

import pathlib
from typing import Annotated, Any

import typer

from mazebench.commands.display import load_mujoco
from mazebench.commands.option_parameters import takes_options
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import EPISODES, EvalOptions
from mazebench.options import options_in
from mazebench.storage.files import make_folder
from mazebench.tasks.task import NOT_IN_EVALUATIONS
from mazebench.tasks.task_options import TaskOptions


@takes_options(TaskOptions, EvalOptions, without=[*NOT_IN_EVALUATIONS, *EPISODES, "checkpoint"])
def prompt(
    values: dict[str, Any],
    episode: Annotated[int, typer.Option(min=0, help="Number of the episode in the evaluation's order.")] = 0,
    decision: Annotated[int, typer.Option(min=1, help="Which question of it; those before are answered.")] = 1,
    out: Annotated[pathlib.Path, typer.Option(help="Folder for prompt.txt and its pictures.")] = pathlib.Path("prompt"),
) -> None:
    """Show what a language model or a person is asked, as text and as pictures; nobody is asked."""
    load_mujoco(renders=False)
    from mazebench.evaluation.chunk import run_trials
    from mazebench.evaluation.plan import build_agent, make_plan

    chosen = options_in(values, EvalOptions)
    chosen["overrides"] = [*chosen.get("overrides", ()), f"model=show:{decision}"]
    plan = make_plan(EvalOptions(agent="llm", task=TaskOptions(**options_in(values, TaskOptions)), **chosen))
    if episode >= len(plan.trials):
        raise InputError(f"expected an episode from 0 to {len(plan.trials) - 1}, found {episode}")
    make_folder(out)
    text = out / "prompt.txt"
    for before in (text, *out.glob("picture-?.png")):
        before.unlink(missing_ok=True)
    agent = build_agent(plan.options, plan.task, plan.agent_class, out)
    for _ in run_trials(agent, plan.task, {episode: plan.trials[episode]}, 1, seed=plan.options.seed):
        if text.exists():
            print(text.read_text(encoding="utf-8"), end="")
            return
    raise InputError(f"expected {decision} decisions in the episode, found fewer")
