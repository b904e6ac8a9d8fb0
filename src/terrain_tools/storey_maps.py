"""Classified voxels as 2-D maps, one a storey: what map_server serves, and heights as an image for geographic programs."""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.storey import GROUND, LETHAL, STOREY_M
from terrain_tools.storeys import Classified, storeys

OCCUPIED, FREE, UNKNOWN = 0, 254, 205
"""Grey values, as map_saver writes them."""
_PIXEL_SCALE, _TIE_POINT, _TRANSFORMATION, _GEO_KEYS, _NO_DATA = 33550, 33922, 34264, 34735, 42113  # tags of a GeoTIFF
_SHORT, _DOUBLE = 3, 12
_PIXEL_IS_AREA = (1, 1, 0, 1, 1025, 0, 1, 1)


@dataclass(frozen=True, eq=False)
class ClassifiedVoxels:
    """Surface voxels of edge `resolution` in map: (N,) columns ix and iy, layers z, and TerrainClass labels."""

    ix: NDArray[np.int32]
    iy: NDArray[np.int32]
    z: NDArray[np.int32]
    label: NDArray[np.uint8]
    resolution: float


@dataclass(frozen=True, eq=False)
class StoreyMap:
    """One storey from above; cell [0, 0] starts at `origin_xy` in map, rows go along y, and all storeys have the same cells.

    grey (ny, nx) uint8: OCCUPIED obstacle or cliff, FREE ground, UNKNOWN. height (ny, nx) float32: of the ground in map, NaN where none is.
    """

    grey: NDArray[np.uint8]
    height: NDArray[np.float32]
    origin_xy: tuple[float, float]
    resolution: float


def read_classified(path: Path, resolution: float) -> ClassifiedVoxels:
    """A run's terrain.npz; ValueError names the file when it is damaged or its voxels are not of that edge."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            centers, label = np.stack([arrays[axis] for axis in "xyz"], axis=1).astype(np.float64), arrays["label"].astype(np.uint8)
    except OSError:
        raise
    except Exception as error:  # numpy and zipfile raise all kinds for a damaged file
        raise ValueError(f"{path}: it cannot be read: {error}") from error
    index = np.round(centers / resolution - 0.5)
    if len(label) != len(index) or not len(index) or not (np.abs((index + 0.5) * resolution - centers) < 0.01 * resolution).all():
        raise ValueError(f"{path}: it holds no classified voxels of {resolution:g} m")
    ix, iy, z = index.astype(np.int32).T
    return ClassifiedVoxels(ix, iy, z, label, resolution)


def storey_maps(voxels: Classified) -> list[StoreyMap]:
    """One map a storey, from below."""
    bands = [(voxels.z >= first) & (voxels.z <= last) for first, last in storeys(voxels)]
    return [_map_of(voxels, band) for band in bands]


def _map_of(v: Classified, of_storey: NDArray[np.bool_]) -> StoreyMap:
    """What is lethal wins over ground of about its height, as in the costmap."""
    x, y = v.ix - v.ix.min(), v.iy - v.iy.min()
    ground, lethal = (np.flatnonzero(of_storey & np.isin(v.label, classes)) for classes in (GROUND, LETHAL))
    height = np.full((int(y.max()) + 1, int(x.max()) + 1), -np.inf, dtype=np.float32)
    np.maximum.at(height, (y[ground], x[ground]), ((v.z[ground] + 1) * v.resolution).astype(np.float32))
    height[np.isinf(height)] = np.nan
    grey = np.where(np.isnan(height), UNKNOWN, FREE).astype(np.uint8)
    off = np.abs((v.z[lethal] + 1) * v.resolution - height[y[lethal], x[lethal]])
    blocks = lethal[~(off >= STOREY_M)]
    grey[y[blocks], x[blocks]] = OCCUPIED
    return StoreyMap(grey, height, (float(v.ix.min() * v.resolution), float(v.iy.min() * v.resolution)), v.resolution)


def pgm_bytes(storey: StoreyMap) -> bytes:
    """The image of map_server: the top row has the greatest y."""
    rows = storey.grey[::-1]
    return f"P5\n# {storey.resolution:g} m/pix\n{rows.shape[1]} {rows.shape[0]}\n255\n".encode("ascii") + rows.tobytes()


def yaml_bytes(storey: StoreyMap, image: str) -> bytes:
    """What map_server is started with; `image` is the image's name, beside it."""
    x, y = storey.origin_xy
    named = json.dumps(image, ensure_ascii=False)  # quoted, for a name may hold what YAML means otherwise
    text = f"image: {named}\nmode: trinary\nresolution: {storey.resolution:g}\norigin: [{x:.6g}, {y:.6g}, 0.0]\n"
    return (text + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n").encode("utf-8")


def tif_bytes(storey: StoreyMap, T_world_map: NDArray[np.float64]) -> bytes:
    """Heights in metres as a GeoTIFF of float32, NaN where no ground is.

    `T_world_map` (4, 4): where the map lies. It moves and turns the image, as at the map's height 0, and is laid on each height.
    """
    from PIL import Image, TiffImagePlugin  # only where there is something to draw

    (ny, nx), size_m, (left, low) = storey.height.shape, storey.resolution, storey.origin_xy
    x, y = left + (np.arange(nx) + 0.5) * size_m, low + (np.arange(ny) + 0.5) * size_m
    by_x, by_y, by_z, up_m = T_world_map[2]
    heights = (by_x * x + by_y * y[:, None] + by_z * storey.height + up_m).astype(np.float32)
    T_map_pixel = np.diag([size_m, -size_m, 0.0, 1.0])
    T_map_pixel[:2, 3] = left, low + ny * size_m
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    tags.tagtype.update({_PIXEL_SCALE: _DOUBLE, _TIE_POINT: _DOUBLE, _TRANSFORMATION: _DOUBLE, _GEO_KEYS: _SHORT})
    tags.update({**_placed(T_world_map @ T_map_pixel), _GEO_KEYS: _PIXEL_IS_AREA, _NO_DATA: "nan"})
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(heights[::-1])).save(file, "TIFF", tiffinfo=tags)
    return file.getvalue()


def _placed(T: NDArray[np.float64]) -> dict[int, tuple[float, ...]]:
    """The tags of an image whose pixels T (4, 4) places: scale and corner, which every program reads, where it is not turned."""
    T[2] = 0.0  # an image has no height of its own
    if T[0, 1] or T[1, 0]:
        return {_TRANSFORMATION: tuple(T.ravel().tolist())}
    return {_PIXEL_SCALE: (float(T[0, 0]), float(-T[1, 1]), 0.0), _TIE_POINT: (0.0, 0.0, 0.0, float(T[0, 3]), float(T[1, 3]), 0.0)}
