"""Where the frames of an SDF file are: poses relative to links, frames, joints and models, by name. Third step of `sdf_world`.

`T_model_x` is a (4, 4) transform into the frame of a model from that of x. By default a link lies in its model, a frame in what it is
attached to, a joint in its child, a model in its parent.
"""

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import inverse
from world_files.sdf_elements import Element, read_pose, text_of, wrong
from world_files.sdf_models import Model

Transform = NDArray[np.float64]
_Trail = tuple[tuple[int, str], ...]  # the frames that are asked for to find another


def T_world_model(model: Model) -> Transform:
    """Pose of a model in the world."""
    return np.eye(4) if model.parent is None else T_world_model(model.parent) @ _T_parent_model(model, ())


def T_model_element(model: Model, element: Element, trail: _Trail = ()) -> Transform:
    """Pose of a link, frame or joint of a model in it. ValueError when that hangs on a frame that is not there, or on itself."""
    by_default = element.get("attached_to", "") if element.tag == "frame" else text_of(element, "child") if element.tag == "joint" else ""
    return _T_model_pose(model, element.find("pose"), by_default, trail)


def T_link_shape(link: Element, model: Model, shape: Element) -> Transform:
    """Pose of a collision or visual in its link."""
    pose = shape.find("pose")
    if pose is None or not _reference(pose):
        return read_pose(pose)
    return inverse(T_model_element(model, link)) @ _T_model_pose(model, pose, "", ())


def _reference(pose: Element | None) -> str:
    """The frame that a pose says it is relative to; before SDF 1.7 the attribute was `frame`."""
    return "" if pose is None else (pose.get("relative_to") or pose.get("frame") or "").strip()


def _T_model_pose(model: Model, pose: Element | None, by_default: str, trail: _Trail) -> Transform:
    named = _reference(pose) or by_default
    return _T_model_frame(model, named, model.element if pose is None else pose, trail) @ read_pose(pose)


def _T_parent_model(model: Model, trail: _Trail) -> Transform:
    assert model.parent is not None
    placed = _T_model_pose(model.parent, model.pose, "", trail)
    return placed @ inverse(_T_model_frame(model, model.placement, model.element, trail)) if model.placement else placed


def _T_model_frame(model: Model, name: str, asked_by: Element, trail: _Trail) -> Transform:
    """The frame of a name, as a model knows it."""
    if name in ("", "__model__", "__root__") or (name == "world" and model.parent is None):
        return np.eye(4)
    if name == "world":
        return inverse(T_world_model(model))
    if (id(model), name) in trail:
        raise wrong(asked_by, f"frame {name!r} hangs on itself")
    found = _named(model, name, (*trail, (id(model), name)))
    if found is None:
        raise wrong(asked_by, f"there is no frame {name!r} in {model.name!r}")
    return found


def _named(model: Model, name: str, trail: _Trail) -> Transform | None:
    head, _, rest = name.partition("::")
    for element in model.element if not rest else ():
        if element.tag in ("link", "frame", "joint") and element.get("name") == name:
            return T_model_element(model, element, trail)
    for nested in model.nested:
        if nested.name == head:
            T_nested_frame = np.eye(4) if not rest else _T_model_frame(nested, rest, nested.element, trail)
            return _T_parent_model(nested, trail) @ T_nested_frame
        if nested.merged and (inner := _named(nested, name, trail)) is not None:
            return _T_parent_model(nested, trail) @ inner
    return None
