"""Where indices come from: dispersion formulas, the default tables, and files of refractiveindex.info."""

from __future__ import annotations

import numpy as np
import pytest

from vgonio.errors import MaterialError
from vgonio.materials import dispersion, material

SILICA = [0, 0.6961663, 0.0684043, 0.4079426, 0.1162414, 0.8974794, 9.896161]  # Malitson 1965
BK7 = [0, 1.03961212, 0.00600069867, 0.231792344, 0.0200179144, 1.01046945, 103.560653]  # Schott


@pytest.mark.parametrize(
    ("formula", "coefficients", "wavelength_um", "expected"),
    [
        (1, SILICA, 0.5876, 1.45846),  # Malitson 1965, table
        (2, BK7, 0.58756, 1.51680),  # n_d of Schott N-BK7
        (3, [2.2718929, -1.0108077e-2, 2, 1.0592509e-2, -2, 2.0816965e-4, -4, -7.6472538e-6, -6, 4.9240991e-7, -8],
         0.58756, 1.51680),  # n_d of BK7 by Schott's polynomial
        (4, [2.7359, 0.01878, 0, 0.01822, 1, 0, 0, 0, 0, -0.01354, 2], 0.532, 1.67421),  # BBO, ordinary: Kato 1986
        (5, [1.5046, 0.0042, -2], 0.5893, 1.51669),  # BK7 by Cauchy's two terms
        (6, [0, 0.05792105, 238.0185, 0.00167917, 57.362], 0.6328, 1.00027653),  # air of 15 °C: Ciddor 1996
    ],
)  # fmt: skip
def test_formulas_give_what_glass_and_air_have(formula, coefficients, wavelength_um, expected):
    """To the last digit of the published index."""
    unit = 10.0 ** -len(str(expected).partition(".")[2])
    assert abs(dispersion(formula, coefficients, np.array([wavelength_um]))[0] - expected) < 0.6 * unit


def test_formulas_that_contain_each_other_agree():
    w = np.linspace(0.4, 2.0, 9)
    expected = dispersion(2, BK7, w)
    squared = [c**0.5 if i and i % 2 == 0 else c for i, c in enumerate(BK7)]  # λ_i in place of λ_i²
    assert np.allclose(dispersion(1, squared, w), expected, rtol=1e-14)
    two = dispersion(2, BK7[:5], w)
    assert np.allclose(dispersion(4, [1, BK7[1], 2, BK7[2], 1, BK7[3], 2, BK7[4], 1], w), two, rtol=1e-14)
    one, b, c = dispersion(2, BK7[:3], w), BK7[1], BK7[2]
    # B λ²/(λ² − C) = B + B C/(λ² − C)
    assert np.allclose(dispersion(9, [1 + b, b * c, c, 0, 0, 1], w), one, rtol=1e-14)


def test_formulas_7_to_9_by_their_definitions():
    """Herzberger's L = 1/(λ² − 0.028); Retro's (n² − 1)/(n² + 2); the resonance of Exotic, largest at λ − C5 = √C6."""
    w = np.sqrt(1.028)  # L = 1
    assert dispersion(7, [3.4, 0.2, 0.03, 1e-3, 2e-4, 3e-5], w) == pytest.approx(
        3.63 + 1e-3 * 1.028 + 2e-4 * 1.028**2 + 3e-5 * 1.028**3, rel=1e-12
    )
    c, w = [0.452505, 0.09939, 0.070537, -0.00015], np.array([0.5, 0.6])
    n2 = dispersion(8, c, w) ** 2
    assert np.allclose((n2 - 1) / (n2 + 2), c[0] + c[1] * w**2 / (w**2 - c[2]) + c[3] * w**2, rtol=1e-12)
    top = dispersion(9, [2.0, 0, 0.01, 0.3, 0.8, 0.04], np.array([0.8, 1.0])) ** 2
    assert np.allclose(top, [2.0, 2.0 + 0.3 / (2 * 0.2)], rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "electronvolt", "expected"),
    [("Ag", 2.01, 0.06 + 4.152j), ("Au", 2.01, 0.21 + 3.272j), ("Cu", 2.01, 0.30 + 3.205j)],
)
def test_default_metals_are_those_of_johnson_and_christy(name, electronvolt, expected):
    """A row of the tables of Johnson and Christy 1972: 2.01 eV is 616.8 nm."""
    assert abs(material(name).index(1239.842 / electronvolt) - expected) < 6e-3


def test_oxides_of_the_default_tables():
    for name, wavelength_nm, expected in (("SiO2", 587.6, 1.45846), ("Al2O3", 589.3, 1.7681), ("H2O", 600.0, 1.332)):
        index = material(name).index(wavelength_nm)
        assert index.real == pytest.approx(expected, abs=1e-4)
        assert 0 <= index.imag < 1e-6


def test_a_table_of_n_and_one_of_k(tmp_path):
    """Two blocks of their own wavelengths: linear between them, known where both are, in µm in the file."""
    path = tmp_path / "made.yml"
    path.write_text(
        "DATA:\n  - type: tabulated n\n    data: |\n      0.4 1.0\n      0.8 2.0\n"
        "  - type: tabulated k\n    data: |\n      0.5 3.0\n      0.9 7.0\n"
    )
    made = material(path)
    assert np.allclose(made.index([500.0, 600.0, 800.0]), [1.25 + 3j, 1.5 + 4j, 2 + 6j], rtol=1e-12)
    assert made.range_nm == pytest.approx((500.0, 800.0))
    for outside in (450.0, 850.0):
        with pytest.raises(MaterialError, match="tabulated from 500 to 800 nm"):
            made.index(outside)
    export = tmp_path / "made.csv"
    export.write_text("wl,n\n0.4,1.0\n0.8,2.0\n\nwl,k\n0.5,3.0\n0.9,7.0\n")
    assert np.allclose(material(export).index([500.0, 600.0]), [1.25 + 3j, 1.5 + 4j], rtol=1e-12)
    assert material(export).range_nm == pytest.approx((500.0, 800.0))


def test_a_formula_in_a_file(tmp_path):
    path = tmp_path / "glass.yml"
    path.write_text(
        "DATA:\n  - type: formula 2\n    wavelength_range: 0.3 2.5\n    coefficients: "
        + " ".join(map(str, BK7)) + "\n"
    )  # fmt: skip
    assert material(path).index(587.56) == pytest.approx(1.51680, abs=6e-6)
    assert material(path).range_nm == pytest.approx((300.0, 2500.0))


def test_a_table_of_the_database_is_known_where_n_and_k_both_are():
    """LaF3 of Amotchkina has n from 0.4 to 12 µm and k from 9.5 µm on."""
    made = material("LaF3:Amotchkina")
    assert made.range_nm == pytest.approx((9493.08, 11973.9), abs=0.1)
    with pytest.raises(MaterialError, match="tabulated from 9493"):
        made.index(600.0)


@pytest.mark.parametrize("author", ["Cheng", "McPeak", "Rakic"])
def test_the_database_and_its_files_are_one(shared, author):
    """The package's table and the file that it comes from, between its rows as well."""
    file = material(shared / "data" / "refractiveindex" / "Al" / f"{author}.yml")
    made = material(f"Al:{author}")
    low, high = (f(made.range_nm[i], file.range_nm[i]) for i, f in ((0, max), (1, min)))
    w = np.linspace(low, high, 300)
    assert np.allclose(made.index(w), file.index(w), rtol=2e-6)  # single precision in the package
    assert material("Al").source == material("Al:Cheng").source
