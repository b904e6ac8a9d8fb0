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
    if arguments.export is None:
        return run_launch(arguments)
    from run_replay.export import export  # loads numba: only when it is asked for

    assert arguments.run is not None
    try:
        count = export(arguments.run, arguments.export)
    except (ValueError, OSError, MemoryError) as error:
        print(f"./replay: {arguments.run}: {error or 'the memory does not suffice'}", file=sys.stderr)
        return 2
    print(f"{count} messages of {arguments.run} written to {arguments.export}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
