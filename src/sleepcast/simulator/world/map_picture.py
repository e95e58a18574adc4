"""The picture of a map, as people look at it: where it lies in the world, and its pixels as a PNG for a browser.

Pillow reads it, where it is installed.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass

MAX_PNG = 4_194_304
"""Bytes of the PNG: real maps have a hundredth of it. A larger picture is made smaller."""


@dataclass(frozen=True, slots=True)
class MapPicture:
    """Where the image of a map lies.

    x, y: the lower left corner of the image in the world, m
    yaw: by which it is turned round that corner, rad, counter-clockwise
    resolution: side of a pixel, m
    """

    file: Path
    x: float
    y: float
    yaw: float
    resolution: float

    def png(self) -> bytes:
        """The image as a PNG of at most MAX_PNG bytes. Raises SettingsError if it cannot be read, MisuseError if a
        library is missing or no picture of it is as small as that."""
        from sleepcast.simulator.world.ros_map import picture

        values, white, _ = picture(self.file)
        from PIL import Image

        shallow = values if white == 255 else values // 257
        pixels = shallow.astype(np.uint8)
        image = Image.fromarray(pixels[:, :, 0] if pixels.shape[2] == 1 else pixels)
        while min(image.size) > 1:
            file = BytesIO()
            image.save(file, "PNG")
            if file.tell() <= MAX_PNG:
                return file.getvalue()
            image = image.reduce(2)
        raise MisuseError(f"{self.file.name}: no picture of at most {MAX_PNG:,} bytes can be made of it")
