"""The command `mazebench`, which is `python -m mazebench` too."""

from __future__ import annotations

from mazebench import stopping


def main() -> None:
    """Runs a command, as `mazebench.cli.main` does. SIGINT and SIGTERM end it with one line."""
    with stopping.listening(), stopping.stoppable(lambda: ("run it again",)):
        from mazebench import cli  # takes a second

        cli.main()


if __name__ == "__main__":
    main()
