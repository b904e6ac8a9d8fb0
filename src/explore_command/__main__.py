"""./explore: from arguments to exit code."""

import sys

from explore_command.arguments import ArgumentProblem, parse, prepare_out
from explore_command.launching import parameter_problem, run_launch, world_problem


def main() -> int:
    try:
        arguments = parse()
        if arguments.check_only:
            print("set up; for a ROS shell: source .ws/devel/setup.bash")
            return 0
        problem = parameter_problem(arguments) or world_problem(arguments)
        if problem:
            raise ArgumentProblem(problem)
        prepare_out(arguments.out, arguments.force)
    except ArgumentProblem as error:
        print(f"./explore: {error}", file=sys.stderr)
        return 2
    return run_launch(arguments)


if __name__ == "__main__":
    sys.exit(main())
