"""`python -m mazebench` is the command `mazebench`."""

from mazebench.cli import main

if __name__ == "__main__":
    main()
