"""The buffer of a growing prefix."""

import numpy as np

from facecode.loop.exact import GrowingBuffer


def test_buffer_grows_and_keeps_its_rows():
    buffer = GrowingBuffer(2, (3,), capacity=2)
    rows = np.arange(7 * 2 * 3, dtype=np.float32).reshape(7, 2, 3)
    for row in rows:
        buffer.append(row)
    np.testing.assert_array_equal(buffer.view(), rows.transpose(1, 0, 2))
