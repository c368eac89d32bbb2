"""Writes the odd images of this folder with Pillow, and what Pillow itself sees in them."""

from pathlib import Path

import numpy as np
from PIL import Image

here = Path(__file__).parent
x, y = np.meshgrid(np.arange(32), np.arange(24))
rgb = np.stack([x * 7, y * 9, x + 3 * y], axis=-1).astype(np.uint8)

cmyk = Image.fromarray(rgb).convert("CMYK")
cmyk.save(here / "cmyk.jpg", quality=95)
Image.open(here / "cmyk.jpg").convert("RGB").save(here / "cmyk.expected.png")

palette = Image.fromarray(rgb).quantize(32)
palette.save(here / "palette.png")
palette.convert("RGB").save(here / "palette.expected.png")

Image.fromarray((x * 2000 + y).astype(np.uint16)).save(here / "gray16.png")
Image.fromarray(np.rint((x * 2000 + y) / 257).astype(np.uint8)).convert("RGB").save(here / "gray16.expected.png")

Image.fromarray(rgb).save(here / "progressive.jpg", quality=95, progressive=True, subsampling=2)
Image.open(here / "progressive.jpg").save(here / "progressive.expected.png")

for orientation in range(1, 9):
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(rgb).save(here / f"orientation-{orientation}.jpg", quality=95, exif=exif)
