"""How every tool says something, what it says of a wrong file or argument, and its exit code then."""

from __future__ import annotations

import sys
from collections.abc import Callable

from explore_command.arguments import ArgumentProblem

BAD_INPUT = 2


def say(text: str) -> None:
    """A line on stderr."""
    print(text, file=sys.stderr, flush=True)


def code_of(tool: str, run: Callable[[], int]) -> int:
    """The exit code that `run` returns; 2, with a line on stderr, where a file or argument is wrong, or the memory does not suffice.

    tool: its name, as in "map_bag". An ArgumentProblem of several lines is told in as many.
    """
    try:
        return run()
    except ArgumentProblem as error:
        lines = str(error).splitlines()
    except OSError as error:
        lines = [f"{error.filename}: {error.strerror or error}" if error.filename else str(error)]
    except MemoryError as error:
        lines = [str(error) or "the memory does not suffice"]
    except ValueError as error:
        lines = [str(error)]
    for line in lines:
        say(f"./{tool}: {' '.join(line.split())}")
    return BAD_INPUT
