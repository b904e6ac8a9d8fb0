"""What a glTF file needs that its reader does not know: then it would give other triangles than the file means, or none."""

import json
import struct
from pathlib import Path
from typing import Any

_LOOKS = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "MSFT_texture_", "KHR_lights_", "EXT_lights_")
_QUANTIZED = "KHR_mesh_quantization"  # read as plain integers, which normalized ones are not
_BINARY = b"glTF"
_CHUNK_AT, _JSON_AT = 12, 20  # bytes of the header of a .glb, and with that of its first chunk


def undecoded_extensions(path: Path) -> list[str]:
    """Names of the extensions that a .gltf or .glb requires and that nobody here decodes, those of its looks left out.

    A file that is damaged requires none.
    """
    try:
        tree = json.loads(_json_of(path.read_bytes()))
        return sorted(name for name in map(str, tree.get("extensionsRequired", [])) if not _is_harmless(name, tree))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, IndexError, struct.error):
        return []


def _json_of(content: bytes) -> bytes:
    if not content.startswith(_BINARY):
        return content
    (length,) = struct.unpack_from("<I", content, _CHUNK_AT)
    return content[_JSON_AT : _JSON_AT + int(length)]


def _is_harmless(name: str, tree: dict[str, Any]) -> bool:
    if name == _QUANTIZED:
        places = [primitive["attributes"]["POSITION"] for mesh in tree["meshes"] for primitive in mesh["primitives"]]
        return not any(tree["accessors"][place].get("normalized") for place in places)
    return name.startswith(_LOOKS)
