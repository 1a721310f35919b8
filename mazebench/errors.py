"""The error of input from outside: the command line prints its one line and exits with status 2."""


class InputError(ValueError):
    """What a user gave can't be used; the message says what was expected and what was found."""


def unknown(kind: str, name: object, available) -> InputError:
    """The `InputError` of a name that no table holds, listing the names that one does."""
    names = ", ".join(sorted(str(item) for item in available)) or "none"
    return InputError(f"unknown {kind} {str(name)[:80]!r}; available: {names}")
