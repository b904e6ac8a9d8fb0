"""dynamic_reconfigure of a node: its service and topics, made of the configurations' own fields.

The library's own server cuts what is out of range and copies flat names to the parameter server, where the next start would find them
unknown. Here a request is judged as a whole, as values are at the start: it is obeyed, or refused with its reason and nothing changes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar, cast

import rospy
from dynamic_reconfigure.encoding import encode_config
from dynamic_reconfigure.msg import Config, ConfigDescription, Group, GroupState, ParamDescription
from dynamic_reconfigure.srv import Reconfigure, ReconfigureRequest, ReconfigureResponse

from ros_adapters.node import Node
from stage_config import ConfigError, Configuration, RuntimeParameter, changed_sections, runtime_parameters

C = TypeVar("C", bound=Configuration)
_MEMORY = "reconfigured"
_GROUP, _TYPES = "Default", {bool: "bool", int: "int", float: "double", str: "str"}


@dataclass(frozen=True)
class Section(Generic[C]):
    """A configuration in use, and what puts another in its place; ValueError where that cannot be, and nothing is changed then."""

    name: str
    config: C
    use: Callable[[C], None]


class Reconfiguration:
    """Serves ~set_parameters; the node's lock is held while values change, so that no callback has some of each.

    A node that is started again has the values that it was told; one that is launched anew has those of the parameter server.
    """

    def __init__(self, node: Node, *sections: Section) -> None:
        """`sections`: where the node's parameters are in use."""
        self._node = node
        self._use = {section.name: cast(Callable[[Configuration], None], section.use) for section in sections}
        self._configs: dict[str, Configuration] = {section.name: section.config for section in sections}
        self._descriptions = node.publisher("~parameter_descriptions", ConfigDescription, latch=True)
        self._updates = node.publisher("~parameter_updates", Config, latch=True)
        self._changes: dict[str, object] = {}
        self._take_up(node.life.kept(_MEMORY, {}))
        self._descriptions.publish(_description(runtime_parameters(self._configs)))
        self._updates.publish(self._now())
        node.serve("~set_parameters", Reconfigure, self._on_set)

    def _take_up(self, changes: dict[str, object]) -> None:
        """What the process before this one was told; its node was started again."""
        try:
            self._change(changes)
        except ValueError as error:
            self._node.diagnostics.dropped("parameters of before", str(error))

    def _on_set(self, request: ReconfigureRequest) -> ReconfigureResponse:
        with self._node.lock:
            self._change(values_of(request.config))
            return ReconfigureResponse(self._now())

    def _change(self, changes: dict[str, object]) -> None:
        try:
            new = changed_sections(self._configs, changes)
        except ConfigError as error:
            raise ValueError("; ".join(str(error).splitlines())) from error
        for count, section in enumerate(new):
            try:
                self._use[section](new[section])
            except ValueError:
                for before in list(new)[:count]:
                    self._use[before](self._configs[before])
                raise
        self._tell(new)
        self._changes |= changes
        self._node.life.keep(_MEMORY, self._changes)

    def _tell(self, new: dict[str, Configuration]) -> None:
        if not new:
            return
        before = runtime_parameters(self._configs)
        self._configs.update(new)
        for name, parameter in runtime_parameters(self._configs).items():
            if parameter.value != before[name].value:
                rospy.loginfo("%s: %s = %r, before %r", self._node.name, name, parameter.value, before[name].value)
        self._updates.publish(self._now())

    def _now(self) -> Config:
        return _encoded({name: parameter.value for name, parameter in runtime_parameters(self._configs).items()})


def values_of(message: Config) -> dict[str, object]:
    """The values of a message by name."""
    return {p.name: p.value for kind in (message.bools, message.ints, message.strs, message.doubles) for p in kind}


def _encoded(values: dict[str, object]) -> Config:
    message = encode_config(values)
    message.groups = [GroupState(name=_GROUP, state=True)]
    return message


def _description(parameters: dict[str, RuntimeParameter]) -> ConfigDescription:
    described = [ParamDescription(p.name, _TYPES[type(p.value)], 0, p.meaning, _edit_method(p)) for p in parameters.values()]
    low, high, now = (_encoded({name: getattr(p, what) for name, p in parameters.items()}) for what in ("low", "high", "value"))
    return ConfigDescription([Group(name=_GROUP, parameters=described)], high, low, now)


def _edit_method(parameter: RuntimeParameter) -> str:
    """Choices, as dynamic_reconfigure writes an enum."""
    if not parameter.choices:
        return ""
    choices = [
        {"name": c, "type": "str", "value": c, "description": "", "ctype": "std::string", "cconsttype": ""} for c in parameter.choices
    ]
    return str({"enum": choices, "enum_description": parameter.meaning})
