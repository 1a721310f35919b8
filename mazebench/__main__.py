"""The command `mazebench`, which is `python -m mazebench` too."""

from __future__ import annotations

import signal


def main() -> None:
    """Runs a command, as `mazebench.cli.main` does; an interrupt while modules are imported ends it without a word."""
    is_heeded = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # in the background it is ignored
    if is_heeded:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from mazebench import cli

    if is_heeded:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    cli.main()


if __name__ == "__main__":
    main()
