"""Message types of packages that Debian 12 does not have, or a robot may lack, built from their definitions."""

from genpy.dynamic import generate_dynamic

PARTS = {
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "octomap_msgs/Octomap": "std_msgs/Header header\nbool binary\nstring id\nfloat64 resolution\nint8[] data\n",
}
"""Definitions of the types that others consist of."""


def message_class(name: str, fields: str, *parts: str) -> type:
    """The class of a message of `fields`; `parts` are the types in them, however deep."""
    text = fields + "".join(f"{'=' * 80}\nMSG: {part}\n{PARTS[part]}" for part in parts)
    found: type = generate_dynamic(name, text)[name]
    return found
