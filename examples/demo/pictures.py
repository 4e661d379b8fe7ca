"""Make the pictures of the README from the demo's result: `make demo`, then `python examples/demo/pictures.py`."""

from __future__ import annotations

from pathlib import Path

import vgonio as vg
from vgonio.compare import rgb_map
from vgonio.report import figures

ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    """Write docs/surface.png, docs/lobes.png and docs/colour.png from out/demo.nc."""
    tree = vg.open(ROOT / "out" / "demo.nc")
    results = {name: tree[name].to_dataset() for name in ("rays", "waves", "measured")}
    few = {name: results[name].sel(theta_i=[0, 40, 70]) for name in ("rays", "waves")}
    pictures = {
        "surface": figures.surface_map(tree["surface"].to_dataset()),
        "lobes": figures.lobes(few, 560),
        "colour": figures.rgb_maps({name: rgb_map(data) for name, data in results.items()}),
    }
    (ROOT / "docs").mkdir(exist_ok=True)
    for name, figure in pictures.items():
        figure.savefig(ROOT / "docs" / f"{name}.png", dpi=110, facecolor="white")


if __name__ == "__main__":
    main()
