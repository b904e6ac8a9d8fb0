"""YAML that people write, as plain values; a key that stands twice is an error, for the last one would win in silence."""

import yaml

_MERGE = "tag:yaml.org,2002:merge"  # <<, of which several add up


def yaml_values(text: str | bytes) -> object:
    """What `yaml.safe_load` makes of a text. yaml.YAMLError, also for a key that stands twice in a mapping, with its lines."""
    return yaml.load(text, _OnceLoader)  # a SafeLoader


class _OnceLoader(yaml.SafeLoader):
    def compose_mapping_node(self, anchor: str | None) -> yaml.MappingNode:
        """As it is written: what a merge brings is not yet in it, and may stand there, too."""
        node: yaml.MappingNode = super().compose_mapping_node(anchor)
        first: dict[tuple[str, str], yaml.ScalarNode] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == _MERGE:
                continue
            other = first.setdefault((key.tag, key.value), key)
            if other is not key:
                lines = [each.start_mark.line + 1 for each in (other, key)]
                raise yaml.YAMLError(f"key {key.value} stands in line {lines[0]}, and again in line {lines[1]}")
        return node
