"""./replay: from arguments to exit code."""

import sys

from explore_command.arguments import ArgumentProblem
from run_replay.arguments import parse
from run_replay.launching import run_launch


def main() -> int:
    try:
        arguments = parse()
    except ArgumentProblem as error:
        print(f"./replay: {error}", file=sys.stderr)
        return 2
    return run_launch(arguments)


if __name__ == "__main__":
    sys.exit(main())
