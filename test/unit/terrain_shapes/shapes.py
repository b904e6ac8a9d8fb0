"""All shapes by their names."""

import shapes_changes
import shapes_drops
import shapes_levels
import shapes_obstacles
import shapes_overhead
import shapes_ramps
import shapes_steps

MODULES = (shapes_ramps, shapes_steps, shapes_drops, shapes_overhead, shapes_obstacles, shapes_levels, shapes_changes)
SHAPES = {shape.name: shape for module in MODULES for shape in module.SHAPES}
