"""Aluminium with and without the spectral shift, as thesis figure 4.13 shows it.

    python examples/12_shift_preview.py [--quick] [-o out] [--size 160]

Three roughnesses of the thesis' blasted aluminium (α of samples 1, 3 and 5 from their height fields). The slope of the
shift, h = 8·10⁻⁴ nm⁻¹ and w = 2.2, is an illustration, because the thesis does not print its fitted values. Writes a
figure for each roughness, and checks that the shift changes the colours as it has to.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from vgonio.render import Preview, delta_e, of_model, preview
from vgonio.report.render_figures import previews

ROUGHNESS = {"sample 1": 0.294, "sample 3": 0.201, "sample 5": 0.122}
SHIFT = {"h": 8e-4, "w": 2.2}


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=Path("out"))
    parser.add_argument("--size", type=int, default=160)
    parser.add_argument("--quick", action="store_true", help="one roughness, 64 × 64 pixels")
    chosen = parser.parse_args(arguments)
    if chosen.quick:
        chosen.size = 64
    chosen.output.mkdir(parents=True, exist_ok=True)
    for name, alpha in list(ROUGHNESS.items())[: 1 if chosen.quick else None]:
        metal = {"alpha": alpha, "material": "Al"}
        materials = [
            of_model("cook-torrance-1982", metal, name=f"{name}, Cook–Torrance"),
            of_model("clausen-2022", metal | SHIFT, name=f"{name}, with shift"),
        ]
        data = preview(materials, Preview(size=chosen.size, samples=8))
        previews(data).savefig(chosen.output / f"{name.replace(' ', '_')}.png", dpi=150)
        check(name, data)


def check(name: str, data) -> None:
    """The highlight turns yellowish, as 4.8 says in numbers; the differences are visible: mean and 95 % of ΔE₀₀.

    At the highlight the half vector is the normal: the ratio of both pictures is a line in λ with the slope h.
    """
    difference = delta_e(data).isel(material=1)
    plain, shifted = data["radiance"].values
    brightest = np.unravel_index(data["tristimulus"].values[0, ..., 1].argmax(), difference.shape)
    blue, red = 1, -2  # 420 and 700 nm
    ratio = (shifted / plain)[brightest]
    print(
        f"{name}: ΔE₀₀ {float(difference.mean()):.2f} on average, 95 % below {float(difference.quantile(0.95)):.2f}; "
        f"highlight at 700 nm × {ratio[red]:.2f}, at 420 nm × {ratio[blue]:.2f}; error {float(data['error'].max()):.1%}"
    )
    slope, level = np.polyfit(data["wavelength"] - 600, ratio, 1)
    assert ratio[red] > 1.05 > 0.95 > ratio[blue]
    assert float(difference.quantile(0.95)) > 1
    assert abs(slope / level / SHIFT["h"] - 1) < 0.1, slope
    print(f"check: slope at the highlight {slope / level:.2e} per nm, h = {SHIFT['h']:.1e}")


if __name__ == "__main__":
    main()
