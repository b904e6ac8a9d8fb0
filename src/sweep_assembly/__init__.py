"""Preprocessing of the laser (thesis 5.3): scans are cleaned, horizontal ones cut short, and the scans of a sweep become one cloud.

Stands between the laser's driver and the mapping: `ScanChain` filters every scan, `SweepAssembler` gives one `Sweep` a turn of the tilt.
For a spinning lidar on the same mount `RevolutionChain` stands in `ScanChain`'s place, and the assembler takes `LidarRevolutions`.
`LineSource` gives every single scan or revolution on its own, for the costmap of a robot that drives.
"""

from sweep_assembly.assembler import Sweep, SweepAssembler
from sweep_assembly.assembly_config import SweepAssemblyConfig
from sweep_assembly.beams import LaserScans, LidarRevolutions
from sweep_assembly.geometry import ScanGeometry, TiltGeometry
from sweep_assembly.line_source import Line, LineSource
from sweep_assembly.revolution import LidarConfig, Revolution
from sweep_assembly.revolution_chain import LEVEL_BEAMS, RevolutionChain
from sweep_assembly.revolution_filter import RevolutionFilter
from sweep_assembly.scan import Scan
from sweep_assembly.scan_chain import ScanChain
from sweep_assembly.scan_filter import ScanFilter, ScanFilterConfig

__all__ = [
    "LEVEL_BEAMS",
    "LaserScans",
    "LidarConfig",
    "LidarRevolutions",
    "Line",
    "LineSource",
    "Revolution",
    "RevolutionChain",
    "RevolutionFilter",
    "Scan",
    "ScanChain",
    "ScanFilter",
    "ScanFilterConfig",
    "ScanGeometry",
    "Sweep",
    "SweepAssembler",
    "SweepAssemblyConfig",
    "TiltGeometry",
]
