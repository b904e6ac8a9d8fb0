"""./register_clouds: how one point cloud lies in another, with its covariance, and whether the answer can be trusted."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from explore_command.arguments import ArgumentProblem, OneLineParser
from mapping_tools.centred_match import carried, centre_of, match_centred
from mapping_tools.cloud_files import VIEWPOINT_FIELDS
from mapping_tools.number_options import check_finite, check_not_negative
from mapping_tools.prepared_cloud import prepared
from mapping_tools.tool_errors import code_of
from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict
from pose_graph_mapping.registration.methods import create_registration
from rigid_geometry import (
    as_transform,
    inverse,
    quat_xyzw_from_transform,
    rpy_from_rotation,
    transform_from_rpy,
)
from stage_config import load_config
from whole_files import check_files, write_whole

Array = NDArray[np.float64]

COVARIANCE_ORDER = "rotation about x, y, z (rad), translation along x, y, z (m); in the frame of the reading"
USABLE, NOT_USABLE = 0, 1


def parser() -> argparse.ArgumentParser:
    p = OneLineParser(
        prog="./register_clouds",
        description="Finds how the cloud READING lies in the cloud REFERENCE: the transform that takes points of the reading to the "
        "reference, how sure it is, and whether it can be trusted. Both have z roughly upwards, in metres. Files: .ply, .pcd, .vtk, "
        ".xyz, a sweep (.npz) of a session folder, or a scan of 3DTK (.3d). Many points at one range, the largest, met nothing and are "
        "left out.",
        epilog="Without a guess the reading is looked for within a few metres of where it lies, at every heading; so it is with a guess of "
        "which no sigma is given. Example: ./register_clouds map.pcd scan.pcd --out T.json. "
        "Exit code: 0 there is a transform to use, 1 refused or ambiguous (the reason is printed, and FILE has "
        "no transform), 2 a file or argument is wrong, 130 interrupted.",
    )
    p.add_argument("reference", type=Path, metavar="REFERENCE", help="the cloud that stays: a map, or a scan")
    p.add_argument("reading", type=Path, metavar="READING", help="the cloud to be placed: a scan, in the frame of its sensor or robot")
    guess = p.add_mutually_exclusive_group()
    angles = ("X", "Y", "Z", "ROLL", "PITCH", "YAW")
    guess.add_argument("--guess", nargs=6, type=float, metavar=angles, help="where the reading is thought to be, in m and rad")
    guess.add_argument("--guess-file", type=Path, metavar="T.json", help="the same, as this program writes it, covariance and all")
    p.add_argument(
        "--guess-sigma", nargs=2, type=float, metavar=("M", "RAD"), help="how well the guess is known, along and about each axis"
    )
    p.add_argument("--out", type=Path, metavar="FILE", help="what was found, as JSON")
    p.add_argument(
        "--origins",
        choices=("fields", "sensor", "none"),
        help=f"where the beams of a cloud started, to tell free space: fields {' '.join(VIEWPOINT_FIELDS)}; sensor: one place, the "
        "VIEWPOINT of a PCD or else the origin of the cloud; none: not known. Default: fields where there are any, else sensor",
    )
    p.add_argument("--min-range", type=float, default=0.0, metavar="M", help="leave out what is nearer to its beam's start, as the vehicle")
    p.add_argument("--set", action="append", default=[], metavar="PARAMETER=VALUE", help="of icp_matcher_node, see docs/parameters.md")
    return p


def configured(texts: Sequence[str]) -> RegistrationConfig:
    """The parameters of the match; ValueError lists what is wrong with them."""
    values = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise ArgumentProblem(f"--set {text}: expected PARAMETER=VALUE, for example max_contradiction=0.02")
        try:
            values[name] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise ArgumentProblem(f"--set {text}: {value!r} is no value") from error
    return load_config(RegistrationConfig, values)


def guess_of(options: argparse.Namespace) -> tuple[Array, Array | None]:
    """T_reference_reading to start from and its covariance, None where nothing is claimed; ValueError when it is no transform."""
    covariance = None
    T = np.eye(4)
    if options.guess_file:
        T, covariance = _guess_in(options.guess_file)
    elif options.guess:
        T = transform_from_rpy(options.guess[:3], tuple(options.guess[3:]))
    try:
        as_transform(T)
    except ValueError as error:
        where = f"--guess-file {options.guess_file}" if options.guess_file else f"--guess {' '.join(f'{v:g}' for v in options.guess)}"
        raise ArgumentProblem(f"{where}: expected a transform: four rows of four finite numbers, a rotation, and 0 0 0 1") from error
    if options.guess_sigma:
        if not all(math.isfinite(s) and s > 0 for s in options.guess_sigma):
            raise ArgumentProblem("--guess-sigma: expected two positive numbers, in m and rad")
        metres, radians = options.guess_sigma
        covariance = np.diag([radians**2] * 3 + [metres**2] * 3)
    return T, covariance


def _guess_in(path: Path) -> tuple[Array, Array | None]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        known = content if isinstance(content, dict) else {"transform": content}
        covariance = known.get("covariance")
        return np.array(known["transform"], dtype=np.float64), None if covariance is None else _checked_covariance(covariance)
    except OSError as error:
        raise ArgumentProblem(f"--guess-file {path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise ArgumentProblem(f"--guess-file {path}: expected JSON with a transform of four rows of four numbers: {error}") from error


def _checked_covariance(values: Any) -> Array:
    covariance = np.array(values, dtype=np.float64)
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all() or np.linalg.eigvalsh(covariance).min() <= 0.0:
        raise ValueError("its covariance is not a positive definite matrix of six rows of six numbers")
    return covariance


def _plain(value: Any) -> Any:
    """Arrays as lists, and None for what is not known."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def report(result: RegistrationResult, seconds: float) -> dict[str, object]:
    """What is written: transform, quaternion and covariance of a usable match only; of an ambiguous one all placements as `rivals`.

    Where a refused reading was laid is `not_verified`.
    """
    T = result.T_reference_reading if result.usable else None
    ambiguous = result.verdict is Verdict.AMBIGUOUS
    placements = np.concatenate([result.T_reference_reading[None], result.rivals]) if ambiguous else result.rivals
    return {
        "verdict": result.verdict.value,
        "reason": result.reason,
        "transform": None if T is None else _plain(T),
        "translation_m": None if T is None else _plain(T[:3, 3]),
        "quaternion_xyzw": None if T is None else _plain(quat_xyzw_from_transform(T)),
        "covariance": None if T is None else _plain(result.covariance),
        "covariance_order": COVARIANCE_ORDER,
        "match_ratio": _plain(result.match_ratio),
        "overlap": _plain(result.overlap),
        "free_space_contradiction": _plain(result.free_space_contradiction),
        "degenerate_directions": _plain(result.degenerate_directions),
        "rivals": _plain(placements),
        "not_verified": _plain(result.T_reference_reading) if _is_not_verified(result) else None,
        "iterations": result.iterations,
        "time_s": round(seconds, 4),
    }


def _is_not_verified(result: RegistrationResult) -> bool:
    """Whether a reading was placed, and the place refused."""
    return result.verdict is Verdict.REFUSED and math.isfinite(result.match_ratio)


def summary(result: RegistrationResult, seconds: float) -> str:
    """What is printed."""
    lines = [f"{result.verdict.value} after {seconds:.2f} s: {result.reason}"]
    placed, degrees = result.T_reference_reading[:3, 3], np.degrees(rpy_from_rotation(result.T_reference_reading[:3, :3]))
    where, turned = (" ".join(f"{v:.{digits}f}" for v in values) for values, digits in ((placed, 4), (degrees, 3)))
    if result.usable:
        sigmas = np.sqrt(np.diag(result.covariance))
        lines.append(f"x y z          {where} m, sigmas {_numbers(sigmas[3:])}")
        lines.append(f"roll pitch yaw {turned} deg, sigmas {_numbers(np.degrees(sigmas[:3]))}")
    elif _is_not_verified(result):
        lines.append(f"not verified: x y z {where} m, roll pitch yaw {turned} deg")
    return "\n".join(lines)


def _numbers(values: Array) -> str:
    return " ".join(f"{v:.3g}" for v in values)


def register(options: argparse.Namespace) -> int:
    """Reads, matches, writes and prints; the exit code."""
    check_finite("--guess", options.guess)
    check_not_negative("--min-range", options.min_range)
    config = configured(options.set)
    if options.out:
        check_files([("--out", options.out)], [options.reference, options.reading, *([options.guess_file] if options.guess_file else [])])
    T_guess, covariance = guess_of(options)
    reference, reading = (
        prepared(path, options.origins, options.min_range, config.voxel_m) for path in (options.reference, options.reading)
    )
    matcher = create_registration(config)
    start = time.perf_counter()
    T_file_reference, T_file_reading = transform_from_rpy(reference.origin), transform_from_rpy(reading.origin)
    near_covariance = None if covariance is None else carried(inverse(T_file_reading), covariance)
    result = match_centred(matcher, reference.cloud, reading.cloud, inverse(T_file_reference) @ T_guess @ T_file_reading, near_covariance)
    result = replace(
        result,
        T_reference_reading=T_file_reference @ result.T_reference_reading @ inverse(T_file_reading),
        covariance=carried(T_file_reading, result.covariance),
        rivals=T_file_reference @ result.rivals @ inverse(T_file_reading),
    )
    seconds = time.perf_counter() - start
    print(summary(result, seconds))
    if options.out:
        found = {**report(result, seconds), "degenerate_directions_about": _plain(centre_of(reading.cloud) + reading.origin)}
        write_whole(options.out, (json.dumps(found, indent=1) + "\n").encode("ascii"))
    return USABLE if result.usable else NOT_USABLE


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code 0: there is a transform to use; 1: refused or ambiguous; 2: a file or argument is wrong."""
    return code_of("register_clouds", lambda: register(parser().parse_args(argv)))


if __name__ == "__main__":
    sys.exit(main())
