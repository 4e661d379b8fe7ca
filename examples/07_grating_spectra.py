"""Why rough surfaces may redden or blue: first orders of many gratings, binned over angle (thesis, figure 4.6).

    python examples/07_grating_spectra.py [-o docs/grating_spectra.png]

Light at normal incidence leaves a grating of spacing d in its first order at sin θ = λ/d. A detector sees a bin of 1°.
Of many gratings it sees those whose order falls into the bin, and each is counted once (as in the thesis, with equal
efficiency for all). Whether the resulting spectra rise or fall depends on how the spacings are distributed:

- evenly in d: the spacings λ/sin θ that serve a bin cover a range ∝ λ, so spectra rise with λ;
- evenly in 1/d (spatial frequency, the variable of a spectral density): the range of sin θ/λ is ∝ 1/λ, so they fall.

Bins close to the mirror direction lack long wavelengths, because no grating is wider than the widest: there the slope
is negative either way. Diffraction alone therefore does not decide whether a surface shifts to red; the distribution
of its spacings does. The power in an order, ∝ 1/λ² for shallow gratings, is left out here as in the thesis. Multiplied
by it, both kinds of spectra fall.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import vgonio as vg
from vgonio.report.style import new_figure, styled

WAVELENGTH_NM = np.arange(400, 701, 10)
SPACING_UM = (1.0, 30.0)
GRATINGS = 400_000
WIDTHS = (2.0, 2.0, 6.0, 4.0, 2.5, 1.0)
SHOWN = (0, 1, 2, 5, 10, 20)  # lower edges of bins in degrees
COLOURS = ("#d55e00", "#e69f00", "#0b4a8f", "#56b4e9", "#a5cdec", "#1a2230")


def spacings(evenly_in: str, count: int = GRATINGS) -> np.ndarray:
    """(count,) µm, evenly spread in "d" or in "1/d" between the narrowest and the widest."""
    share = (np.arange(count) + 0.5) / count
    narrow, wide = SPACING_UM
    if evenly_in == "d":
        return narrow + share * (wide - narrow)
    return 1 / (1 / wide + share * (1 / narrow - 1 / wide))


def first_order_deg(wavelength_nm: float, spacing_um: np.ndarray) -> np.ndarray:
    """Angle of the first order at normal incidence, away from the normal."""
    return np.degrees(np.arcsin(wavelength_nm * 1e-3 / spacing_um))


def spectra(evenly_in: str) -> np.ndarray:
    """(bin of 1°, wavelength) number of gratings whose first order falls into the bin."""
    d = spacings(evenly_in)
    return np.stack(
        [np.histogram(first_order_deg(w, d), bins=np.arange(0, 31))[0] for w in WAVELENGTH_NM], axis=1
    ).astype(float)


def exponent(spectrum: np.ndarray) -> float:
    """p of the power λᵖ that fits a spectrum."""
    return float(np.polyfit(np.log(WAVELENGTH_NM), np.log(spectrum), 1)[0])


def straightness(spectrum: np.ndarray) -> float:
    """Coefficient of determination of a line over λ."""
    line = np.polyval(np.polyfit(WAVELENGTH_NM, spectrum, 1), WAVELENGTH_NM)
    return float(1 - np.sum((spectrum - line) ** 2) / np.sum((spectrum - spectrum.mean()) ** 2))


@styled
def figure(found: dict[str, np.ndarray]):
    """Angles of first orders, and the spectra of some bins for both spreads of spacings."""
    made = new_figure(10.0, 3.3)
    axes = made.subplots(1, 3)
    for d in (1, 1.5, 2, 3, 5, 10, 30):
        angle = first_order_deg(WAVELENGTH_NM, np.array(d))
        axes[0].plot(WAVELENGTH_NM, angle, color="#0b4a8f")
        axes[0].text(705, angle[-1], f"{d:g} µm", va="center", fontsize=7.5)
    axes[0].set(title="(a) first order of a grating", xlabel="wavelength / nm", ylabel="diffraction angle / °")
    axes[0].set_xlim(400, 760)
    for ax, (name, values), letter in zip(axes[1:], found.items(), "bc"):
        for edge, colour, width in zip(SHOWN, COLOURS, WIDTHS):
            label = f"{edge} … {edge + 1}°"
            ax.plot(WAVELENGTH_NM, values[edge] / values[edge].mean(), color=colour, lw=width, label=label)
        ax.set(title=f"({letter}) spacings even in {name}", xlabel="wavelength / nm", ylim=(0, 2.6))
        ax.set_ylabel("spectrum over its mean")
    axes[2].legend(
        ncol=2, loc="upper right", title="bins of 1° (from 2° on, all alike)", fontsize=7.5, title_fontsize=7.5
    )
    return made


def solver_agrees() -> None:
    """The solver's orders leave where the figure says: |θ_o| of order 1 for three gratings, to 1e-9."""
    for d in (2.0, 5.0, 10.0):
        surface = vg.surface.sinusoid(period_um=d, amplitude_um=0.02, shape=(4, 200), pitch_um=d / 200)
        data = vg.wave.Kirchhoff("perfect", WAVELENGTH_NM[::10]).orders(surface, [0])
        theta_o = data.theta_o.sel(order=1, theta_i=0).values
        expected = [first_order_deg(w, np.array(d)) for w in WAVELENGTH_NM[::10]]
        assert np.allclose(-theta_o, expected, atol=1e-9), (theta_o, expected)


def main(arguments: list[str] | None = None) -> None:
    """Draw the figure and check what it shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("grating_spectra.png"))
    asked = parser.parse_args(arguments)
    found = {name: spectra(name) for name in ("d", "1/d")}
    figure(found).savefig(asked.output, dpi=130, facecolor="white")
    solver_agrees()
    print("bin       even in d: power of λ, R² of a line   even in 1/d: power of λ, R² of a line")
    for edge in SHOWN:
        d, inverse = found["d"][edge], found["1/d"][edge]
        if edge < 2:
            assert d[-1] < d.max()  # the widest spacing ends it
            print(f"{edge:2d} … {edge + 1:2d}°  lacks long wavelengths")
            continue
        powers, lines = [exponent(s) for s in (d, inverse)], [straightness(s) for s in (d, inverse)]
        print(f"{edge:2d} … {edge + 1:2d}° {powers[0]:17.3f} {lines[0]:17.4f} {powers[1]:24.3f} {lines[1]:17.4f}")
        # a histogram of 400,000 gratings: 1 % on the power; 1/λ over 400 … 700 nm is a line to a few per cent
        assert np.allclose(powers, [1, -1], atol=0.02), powers
        assert lines[0] > 0.995, lines
        assert lines[1] > 0.95, lines
    print("check: spectra ∝ λ for spacings even in d, ∝ 1/λ for spacings even in 1/d")


if __name__ == "__main__":
    main()
