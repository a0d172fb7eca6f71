"""A contact sheet of the ground textures: a row for each family, training above, test below.

python scripts/texture_sheet.py textures.png
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from tr_grasp.sensing.textures import FAMILIES, draw_recipe, texture_image

COLUMNS, EDGE_PX, GAP_PX, TEXT_PX = 6, 160, 6, 110


def main() -> None:
    """Write the sheet."""
    rows = [(split, family) for split, families in FAMILIES.items() for family in families]
    step = EDGE_PX + GAP_PX
    sheet = Image.new("RGB", (TEXT_PX + COLUMNS * step, len(rows) * step), "white")
    pencil, font = ImageDraw.Draw(sheet), ImageFont.load_default(18)
    for row, (split, family) in enumerate(rows):
        pencil.text((8, row * step + EDGE_PX // 2 - 20), f"{family}\n{split}", fill="black", font=font)
        for column in range(COLUMNS):
            recipe = draw_recipe(split, np.random.default_rng([row, column]), family)
            picture = (255 * texture_image(recipe)).astype(np.uint8)
            sheet.paste(Image.fromarray(picture).resize((EDGE_PX,) * 2), (TEXT_PX + column * step, row * step))
    sheet.save(Path(sys.argv[1] if len(sys.argv) > 1 else "textures.png"))


if __name__ == "__main__":
    main()
