"""The command line: assembles the commands and turns errors into one line and an exit status."""

from __future__ import annotations

import errno
import functools
import importlib
import io
import itertools
import re
import sys
from typing import Annotated, NoReturn

import typer

from mazebench import __version__, stopping
from mazebench.commands.bench import bench
from mazebench.commands.check_map import check_map
from mazebench.commands.collect import collect
from mazebench.commands.compare import compare
from mazebench.commands.eval import evaluate
from mazebench.commands.generate import generate
from mazebench.commands.list import list_
from mazebench.commands.merge import merge
from mazebench.commands.play import play
from mazebench.commands.prompt import prompt
from mazebench.commands.render import render
from mazebench.commands.report import report
from mazebench.commands.train import train
from mazebench.constants import TASK_VERSION
from mazebench.errors import InputError, RunError, one_line, remarks_to, shortened

_LONGEST = 2000  # characters of a message; an agent's InputError may be of any length

# What click raises where it can't parse a command line. Typer uses click or, in later versions, a copy of its own.
_ClickException = importlib.import_module(typer.BadParameter.__module__).ClickException

app = typer.Typer(
    help="Zero-shot navigation in unseen 3-D mazes from abstract top-down maps, on MuJoCo.",
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command(short_help="Make mazes: MJCF, text, picture, mesh.")(generate)
app.command("eval", short_help="Evaluate agents on unseen mazes.")(evaluate)
app.command(short_help="Make one run of its shares.")(merge)
app.command("check-map", short_help="Tell what an old map costs a robot, and where.")(check_map)
app.command(short_help="Drive episodes yourself.")(play)
app.command(short_help="Compare two agents on the same episodes.")(compare)
app.command(short_help="Collect demonstrations of an agent.")(collect)
app.command(short_help="Train an agent on the training mazes.")(train)
app.command(short_help="Make tables, figures and a page of results.")(report)
app.command(short_help="Film or picture an episode.")(render)
app.command(short_help="Show what a language model is asked.")(prompt)
app.command(short_help="Measure speed on this machine.")(bench)
app.command("list", short_help="List tasks, agents, sizes and kinds of mazes.")(list_)


def main() -> None:
    """Runs a command: exit status 0 done, 1 a run failed, 2 bad input, which gets one line and no traceback.

    `mazebench.__main__.main` handles SIGINT and SIGTERM.
    """
    sys.argv[0] = "mazebench"  # as users type it: provenance keeps the command
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files need not be legal Unicode
    try:
        for before, word in itertools.pairwise(sys.argv):
            if not word or re.fullmatch(r"--[\w-]+=", word):  # an empty path would be the working directory
                raise InputError(f"expected a value of {word.rstrip('=') or before}, found an empty one")
        with remarks_to(functools.cache(_print_line)):  # each only once
            status = app(sys.argv[1:] or ["--help"], prog_name="mazebench", standalone_mode=False) or 0
            stopping.finish()
            sys.exit(status)
    except _ClickException as error:
        _fail(error.format_message().replace("Value error, ", ""), 2)  # with which pydantic begins, through typer
    except InputError as error:
        _fail(str(error), 2)
    except OSError as error:
        if error.errno == errno.EMFILE:
            _fail("expected more open files than this process may have; raise the limit by `ulimit -n`", 2)
        if error.filename is None:  # as of the stream that output goes to
            _fail(f"can't write: {error.strerror or error}", 1)
        _fail(f"{error.filename}: {error.strerror or error}", 2)
    except RunError as error:
        _fail(str(error), 1)


def _fail(message: str, status: int) -> NoReturn:
    _print_line(shortened(message, _LONGEST))
    sys.exit(status)


def _print_line(line: str) -> None:
    print(f"mazebench: {one_line(line)}", file=sys.stderr)


def _print_version(asked: bool) -> None:
    if asked:
        print(f"mazebench {__version__} (benchmarks paper and tracks, version {TASK_VERSION})")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass
