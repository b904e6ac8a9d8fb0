"""The slide of a skid steer on a slope."""

import numpy as np
import pytest

from rigid_geometry import slide_per_rad


def test_slide_is_downhill_and_grows_with_the_root_of_the_fall():
    assert slide_per_rad(0.1, 0.15) == pytest.approx(0.15) and slide_per_rad(-0.4, 0.15) == pytest.approx(-0.3)
    assert slide_per_rad(0.0, 0.15) == 0.0 and not slide_per_rad([-0.2, 0.2], 0.0).any()
    falls = np.linspace(-0.3, 0.3, 601)
    assert (np.diff(slide_per_rad(falls, 0.15)) > 0).all() and np.abs(np.diff(slide_per_rad(falls, 0.15))).max() < 0.004
