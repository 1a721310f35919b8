"""The errors that the command line prints as one line: of bad input (exit status 2) and of failed runs (1)."""


class InputError(ValueError):
    """What a user gave can't be used; the message says what was expected and what was found."""


class RunError(RuntimeError):
    """A run that was well asked for can't go on; the message says what happened and what is kept."""


def unknown(kind: str, name: object, available) -> InputError:
    """The `InputError` of a name that no table holds, listing the names that one does."""
    names = ", ".join(sorted(str(item) for item in available)) or "none"
    return InputError(f"unknown {kind} {str(name)[:80]!r}; available: {names}")
