"""The colours of the classes, as in the thesis's figures 5.14 to 5.20, for whatever shows or writes a classified map."""

from octomap_server_3dnav.terrain.classify import TerrainClass

CLASS_RGB: dict[TerrainClass, tuple[float, float, float]] = {
    TerrainClass.TRAVERSABLE: (0.1, 0.75, 0.2),
    TerrainClass.OBSTACLE: (0.85, 0.1, 0.1),
    TerrainClass.CLIFF: (0.6, 0.1, 0.8),
    TerrainClass.INFLATION: (1.0, 0.6, 0.1),
    TerrainClass.FRONTIER: (0.1, 0.35, 1.0),
    TerrainClass.POTENTIAL_CLIFF: (0.1, 0.85, 0.95),
}
