"""What the properties of the likelihood ratios draw: frames, places and values, sound or not."""

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

same = settings(derandomize=True, deadline=None, max_examples=150)
ANY = st.floats(allow_nan=True, allow_infinity=True, width=64)
CELLS = st.floats(0.0, 20.0) | st.sampled_from([1e40, 0.0]) | ANY
PLACES = st.floats(-1.0, 8.0) | ANY
POSITIVE = st.floats(1e-4, 30.0) | ANY
SHAPES = st.sampled_from([(5, 4), (1, 1), (3, 7), (0, 2)])
usual = st.sampled_from([True, True, True, False])


def draw_frame(data, shape, typical):
    one = st.floats(0.0, 20.0) if typical else CELLS
    values = data.draw(st.lists(one, min_size=4, max_size=4))
    return np.resize(np.array(values), shape)
