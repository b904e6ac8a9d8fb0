"""./explore: from arguments to exit code."""

import sys
from dataclasses import replace

from explore_command.arguments import ArgumentProblem, ExploreArguments, input_files, parse
from explore_command.launching import as_robot_is_built, effective_robot, parameter_problem, run_launch, world_problem
from explore_command.limits import limits_problem
from explore_command.results_folder import claimed_out, prepare_out
from explore_command.sessions import clock_after
from robot_body import RobotBody, urdf_file
from whole_files import words_end_nobody


def main(argv: list[str] | None = None) -> int:
    words_end_nobody()
    try:
        arguments = parse(argv)
        if arguments.check_only:
            print("set up; for a ROS shell: source .ws/devel/setup.bash")
            return 0
        if problem := limits_problem() or parameter_problem(arguments):
            raise ArgumentProblem(problem)
        robot = effective_robot(arguments)
        arguments = as_robot_is_built(arguments, robot)
        if problem := world_problem(arguments, robot):
            raise ArgumentProblem(problem)
        out, lock = claimed_out(arguments.out, arguments.may_be_elsewhere)
        if out != arguments.out:
            print(f"./explore: another run writes into {arguments.out}; this one writes into {out}", flush=True)
            arguments = replace(arguments, out=out)
        clock_start_s = _prepare(arguments, robot)
    except ArgumentProblem as error:
        for line in str(error).splitlines():
            print(f"./explore: {line}", file=sys.stderr)
        return 2
    return run_launch(arguments, robot, clock_start_s, lock)


def _prepare(arguments: ExploreArguments, robot: RobotBody) -> float:
    """Makes the folder of the run, with the session that it goes on with, if there is one; what the clock starts at, in seconds."""
    inputs = [*input_files(arguments), urdf_file(robot)]
    try:
        if arguments.resume:
            clock_start_s = clock_after(arguments.out, "--resume")
            prepare_out(arguments.out, force=True, keep_session=True, inputs=inputs)
            return clock_start_s
        clock_start_s = clock_after(arguments.map, "--map") if arguments.map else 0.0
        prepare_out(arguments.out, arguments.force, inputs=inputs)
        if arguments.map and not arguments.goals:
            from pose_graph_mapping.session.session_store import copy_session  # loads gtsam: only when it is asked for

            copy_session(arguments.map, arguments.out)
        return clock_start_s
    except (ValueError, OSError) as error:
        raise ArgumentProblem(str(error)) from error


if __name__ == "__main__":
    sys.exit(main())
