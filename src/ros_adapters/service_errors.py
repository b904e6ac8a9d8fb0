"""What a service said, without rospy's words around it."""

import ast
import re

import rospy

_REPORTED = re.compile(r"""responded with an error: (b?(['"]).*\2)$""", re.DOTALL)
_PREFIX = re.compile("^(error processing|service cannot process) request: ")


def reason_of(error: rospy.ServiceException) -> str:
    """The reason that the service gave, or the whole text where it gave none."""
    reported = _REPORTED.search(str(error))
    if reported is None:
        return str(error)
    said = ast.literal_eval(reported.group(1))  # rospy writes the bytes that came as Python does
    return _PREFIX.sub("", said.decode(errors="replace") if isinstance(said, bytes) else str(said))
