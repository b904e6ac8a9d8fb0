"""The tree of models of an SDF file: nested ones, and included ones with their files. Second step of `sdf_world`.

A model that is not there, and whatever else is not understood, is left out and noted.
"""

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import fromstring

from world_files.model_paths import ModelPaths, model_name, sdf_file_of
from world_files.sdf_elements import Element, place, read_xml, text_of, wrong

NOT_UNDERSTOOD = {"plugin": "filename", "actor": "name", "road": "name", "population": "name"}
"""Elements that are left out with a word, and the attribute that tells one from another."""
_READ_OF_INCLUDE = ("uri", "name", "pose", "placement_frame", "static")  # the last says what is so: everything stands still
_MOST_NESTED = 30
_GROUND_PLANE = "<model name='ground_plane'><link name='link'><collision name='c'><geometry><plane/></geometry></collision></link></model>"


@dataclass
class Notes:
    """What was left out or is coarser than the file, and where, in the order in which it was met."""

    places: dict[str, list[str]] = field(default_factory=dict)

    def left_out(self, what: str, element: Element) -> None:
        """Notes it."""
        self.told(f"{what}: left out", element)

    def told(self, sentence: str, element: Element) -> None:
        """Notes a sentence on an element."""
        self.places.setdefault(sentence, []).append(place(element))

    def lines(self) -> tuple[str, ...]:
        """One line for each kind of thing, with the place of the first."""
        return tuple(
            f"{places[0]}: {sentence}" + (f" ({len(places)} times)" if len(places) > 1 else "") for sentence, places in self.places.items()
        )


@dataclass(frozen=True, eq=False)
class Model:
    """A model, or the world, which has no parent.

    `element` holds its links and frames, `folder` is that of its file. `pose`: the <pose> that places its frame `placement`, or its own
    where that is "", in its parent. `merged`: its frames are its parent's, too.
    """

    name: str
    element: Element
    folder: Path
    parent: "Model | None" = None
    pose: Element | None = None
    placement: str = ""
    merged: bool = False
    nested: "list[Model]" = field(default_factory=list)


class ModelReader:
    """Reads a file and all that it includes."""

    def __init__(self, paths: ModelPaths, notes: Notes) -> None:
        self._paths, self._notes = paths, notes

    def world(self, path: Path) -> Model:
        """The first world of a file, or a world of its models. ValueError when there is neither, or something in it is wrong."""
        root = read_xml(path)
        world = root.find("world") if root.tag in ("sdf", "gazebo") else None
        if world is None and root.find("model") is None:
            raise wrong(root, "an SDF file has a <world> or a <model> in <sdf>")
        for other in root.findall("world")[1:]:
            self._notes.left_out(f"world {other.get('name', '')!r}, for the file's first is read", other)
        found = Model("world", root if world is None else world, path.parent)
        self._fill(found, (path.resolve(),))
        return found

    def _fill(self, model: Model, files: tuple[Path, ...], depth: int = 0) -> None:
        """Adds what is nested in a model; `files` are those that include each other to come here."""
        if depth > _MOST_NESTED:
            raise wrong(model.element, f"more than {_MOST_NESTED} models in each other")
        state = {each.get("name"): each.find("pose") for each in model.element.findall("state/model")}
        for child in model.element:
            if child.tag in NOT_UNDERSTOOD:
                self._notes.left_out(_told(child), child)
            elif child.tag == "model":
                pose = state.get(child.get("name"))  # where it was when the world was saved
                self._add(model, child, model.folder, child.find("pose") if pose is None else pose)
                self._fill(model.nested[-1], files, depth + 1)
            elif child.tag == "include":
                self._include(model, child, files, depth)

    def _add(self, parent: Model, element: Element, folder: Path, pose: Element | None, include: Element | None = None) -> None:
        told = element if include is None else include
        name = (text_of(include, "name") if include is not None else "") or element.get("name", "")
        placement = (text_of(include, "placement_frame") if include is not None else "") or element.get("placement_frame", "")
        parent.nested.append(Model(name, element, folder, parent, pose, placement, told.get("merge") in ("true", "1")))

    def _include(self, parent: Model, include: Element, files: tuple[Path, ...], depth: int) -> None:
        uri = text_of(include, "uri")
        if not uri:
            raise wrong(include, "it has no <uri>")
        for child in include:
            if child.tag not in _READ_OF_INCLUDE:
                self._notes.left_out(f"{_told(child)} in an <include>", child)
        element, file = self._included(include, uri, parent.folder)
        if element is None:
            return
        if file is not None and file.resolve() in files:
            raise wrong(include, f"{uri} includes itself")
        pose = include.find("pose")
        self._add(parent, element, parent.folder if file is None else file.parent, element.find("pose") if pose is None else pose, include)
        self._fill(parent.nested[-1], files if file is None else (*files, file.resolve()), depth + 1)

    def _included(self, include: Element, uri: str, folder: Path) -> tuple[Element | None, Path | None]:
        """The model that an include means, and its file: of what all of Gazebo knows, our own; None for what is left out."""
        found = self._paths.found(uri, folder)
        file = None if found is None else sdf_file_of(found)
        if file is None:
            known = model_name(uri).lower().replace(" ", "_")
            if known == "ground_plane":
                return fromstring(_GROUND_PLANE), None
            if known != "sun":
                self._notes.left_out(f"model {uri}, which is in no folder of models", include)
            return None, None
        root = read_xml(file)
        model = root if root.tag == "model" else root.find("model")
        if model is None:
            self._notes.left_out(f"{uri}, which holds no model", include)
        return model, file


def _told(element: Element) -> str:
    return f"{element.tag} {element.get(NOT_UNDERSTOOD.get(element.tag, 'name'), '')}".strip()
