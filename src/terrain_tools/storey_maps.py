"""Classified voxels as 2-D maps, one a storey: what map_server serves, and heights as an image for geographic programs."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.storey import GROUND, LETHAL, STOREY_M
from terrain_tools.storeys import Classified, storeys

OCCUPIED, FREE, UNKNOWN = 0, 254, 205
"""Grey values, as map_saver writes them."""
_PIXEL_SCALE, _TIE_POINT, _GEO_KEYS, _NO_DATA = 33550, 33922, 34735, 42113  # tags of a GeoTIFF
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
    text = f"image: {image}\nmode: trinary\nresolution: {storey.resolution:g}\norigin: [{x:.6g}, {y:.6g}, 0.0]\n"
    return (text + "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n").encode("utf-8")


def tif_bytes(storey: StoreyMap, origin: NDArray[np.float64]) -> bytes:
    """Heights in metres as a GeoTIFF of float32, NaN where no ground is; `origin` (3,): where the map's own lies in the world."""
    from PIL import Image, TiffImagePlugin  # only where there is something to draw

    tags, size_m = TiffImagePlugin.ImageFileDirectory_v2(), storey.resolution
    tags.tagtype.update({_PIXEL_SCALE: _DOUBLE, _TIE_POINT: _DOUBLE, _GEO_KEYS: _SHORT})
    left, top = storey.origin_xy[0] + origin[0], storey.origin_xy[1] + origin[1] + storey.height.shape[0] * size_m
    tags[_PIXEL_SCALE], tags[_TIE_POINT] = (size_m, size_m, 0.0), (0.0, 0.0, 0.0, float(left), float(top), 0.0)
    tags[_GEO_KEYS], tags[_NO_DATA] = _PIXEL_IS_AREA, "nan"
    file = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(storey.height[::-1] + np.float32(origin[2]))).save(file, "TIFF", tiffinfo=tags)
    return file.getvalue()
