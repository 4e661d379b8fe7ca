"""Relative calibration (thesis 2.28–2.32) and the virtual instrument: there and back within the stated errors."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import xarray as xr

from vgonio.directions import half_vectors, unit_vectors
from vgonio.errors import FileFormatError, InputError, VgonioWarning
from vgonio.measure import formats
from vgonio.measure.calibration import calibrate, calibration_factor
from vgonio.measure.hardware import Spectrometer, Tilt, tilt_effect, tilted_angles
from vgonio.measure.instrument import Instrument, line_matrix
from vgonio.measure.isotropic import IsotropicBrdf, isotropic, sampled
from vgonio.measure.standards import lambertian_standard, read_reflectance

NM = np.array([450.0, 550.0, 650.0])
LAMP = np.array([1.2e5, 2.5e5, 4.0e5])  # C ΔE₀ of a halogen lamp, rising with the wavelength
LARGE = Spectrometer(full_scale=1e9)  # for counts without noise
IDEAL = Instrument(aperture_deg=0, divergence_deg=0, bandwidth_nm=0, repeatability_deg=0, spectrometer=LARGE)


def lambert(rho=0.99, nm=NM):
    return IsotropicBrdf(nm, lambda wi, wo: np.full((len(wi), nm.size), rho / np.pi), "Lambert")


def counted(instrument, brdf, theta_i, theta_o, seed, noisy=True):
    seen = instrument.seen(brdf, theta_i, theta_o)
    return instrument.counts(seen, LAMP, seed, noisy)


# ---- calibration
def test_without_noise_it_is_exact(facets):
    """The factor comes back, and the BRDF of a sample, whatever the angle and wavelength."""
    standard = counted(IDEAL, lambert(), [10], np.arange(-80, 81, 10), 0, noisy=False)
    factor = calibration_factor(standard, lambertian_standard(NM, [0.99] * 3))
    np.testing.assert_allclose(factor.factor, LAMP, rtol=1e-12)
    np.testing.assert_allclose(factor.factor_by_angle, np.tile(LAMP, (17, 1)), rtol=1e-12)
    assert factor.attrs["angles"] == 17
    sample = facets(0.4, 0.3)
    found = calibrate(counted(IDEAL, sample, [0, 30, 60], np.arange(-80, 81, 10), 0, noisy=False), factor)
    np.testing.assert_allclose(found.brdf, sampled(sample, [0, 30, 60], np.arange(-80, 81, 10)).brdf, rtol=1e-12)


def test_the_formula_by_hand():
    """One count: V = 1000 at 60° with C ΔE₀ = 4000: f = 1000 / (4000 · 0.5) = 0.5 sr⁻¹ (2.31)."""
    ideal = lambertian_standard(NM, [1.0] * 3)
    counts = IDEAL.counts(IDEAL.seen(lambert(1.0), [10], [0, 20]), 4000.0, noisy=False)
    factor = calibration_factor(counts, ideal, theta_o_deg=[0, 20])
    single = counts.isel(theta_o=[0]).assign_coords(theta_i=[60.0])
    single["counts"][:] = 1000.0
    assert calibrate(single, factor).brdf.values.ravel() == pytest.approx([0.5] * 3)


def test_a_shadowed_retro_direction_is_left_out():
    """In the second configuration the detector hides the lamp at θ_o = θ_i = 10°: 16 angles remain."""
    white = counted(IDEAL, lambert(), [10], np.arange(-80, 81, 10), 0, noisy=False)
    factor = calibration_factor(white.where(white.theta_o != 10), lambertian_standard(NM, [0.99] * 3))
    assert factor.attrs["angles"] == 16
    np.testing.assert_allclose(factor.factor, LAMP, rtol=1e-12)


def test_swapped_counts_are_told():
    """Counts of sample and standard the wrong way round: a glossy and a grey sample, each tells in its own way."""
    angles = np.arange(-80, 81, 10)
    white = counted(IDEAL, lambert(), [10], angles, 0, noisy=False)
    grey = counted(IDEAL, lambert(0.5), [10], angles, 0, noisy=False)
    # a lobe of 20° on a dark ground
    lobe = 0.05 + 2 * np.exp(-(((angles + 10) / 20) ** 2))
    glossy = white.assign(counts=white.counts * xr.DataArray(lobe, dims="theta_o"))
    known = lambertian_standard(NM, [0.99] * 3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for sample in (grey, glossy):
            calibrate(sample, calibration_factor(white, known))
    with pytest.warns(VgonioWarning, match=r"brighter than an ideal white.*1\.96.*changed places"):
        calibrate(white, calibration_factor(grey, known))
    with pytest.warns(VgonioWarning, match="vary by .* with θ_o.*changed places"):
        calibrate(white, calibration_factor(glossy, known))


def test_one_wavelength_or_all():
    """The standard falls by 4 % towards the blue: taken at 550 nm alone, the sample's spectrum carries that 4 %."""
    reflectance = np.array([0.95, 0.99, 0.99])
    white = IsotropicBrdf(NM, lambda wi, wo: np.tile(reflectance / np.pi, (len(wi), 1)), "")
    counts = counted(IDEAL, white, [10], np.arange(-80, 81, 10), 0, noisy=False)
    standard = lambertian_standard(NM, reflectance)
    each = calibration_factor(counts, standard, standard_nm=None)
    one = calibration_factor(counts, standard, standard_nm=550.0)
    np.testing.assert_allclose(each.factor, LAMP, rtol=1e-12)
    np.testing.assert_allclose(one.factor / LAMP, [0.95 / 0.99, 1, 1], rtol=1e-12)
    assert (each.attrs["standard_nm"], one.attrs["standard_nm"]) == ("each wavelength its own", 550.0)


@pytest.mark.parametrize("standard_error", [0.0, 0.01])
def test_chi_square_of_the_round_trip(facets, standard_error, agreement):
    """200 instruments: counts with noise, angles and a standard in error, calibrated; pulls as the errors say.

    The mean of χ² per value is 1 within 5 of its own standard errors (√(2/200) for values that share the standard; the
    3 wavelengths × 17 angles of one seed are not independent then), and no wavelength or angle stands out.
    """
    instrument = Instrument(
        aperture_deg=0, divergence_deg=0, bandwidth_nm=0, repeatability_deg=0.05, spectrometer=Spectrometer(snr=300)
    )
    sample, angles = facets(0.2, 0.2), np.arange(-80, 81, 10)
    truth = sampled(sample, [20, 60], angles).brdf.values
    white_seen, seen = instrument.seen(lambert(), [10], angles), instrument.seen(sample, [20, 60], angles)
    pulls, offsets = [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        true_white = white_seen.assign(brdf=white_seen.brdf * (1 + standard_error * rng.normal()))
        white = instrument.counts(true_white, LAMP / 10, rng)
        counts = instrument.counts(seen, LAMP / 10, rng)
        factor = calibration_factor(white, lambertian_standard(NM, [0.99] * 3), standard_uncertainty=standard_error)
        found = calibrate(counts, factor, repeatability_deg=0.05)
        pulls.append((found.brdf.values - truth) / found.brdf_stderr.values)
        offsets.append(found.brdf.values - truth)
    chi = np.mean(np.square(pulls), axis=0)
    assert chi.mean() == pytest.approx(1, abs=5 * np.sqrt(2 / 200) if standard_error else 0.05)
    agreement(
        "counts with noise, calibrated, 200 seeds: χ² of each value",
        "the BRDF they came from: 1",
        chi,
        (1 - 6 * np.sqrt(2 / 200), 1 + 6 * np.sqrt(2 / 200)),
    )
    bias = np.mean(offsets, axis=0) / (np.std(offsets, axis=0) / np.sqrt(200))
    assert np.abs(bias).max() < 4.5  # 102 normal values


def test_each_source_of_error(facets):
    """The parts add in squares; the standard's is common and relative, the angles' that of the derivative."""
    instrument = Instrument(aperture_deg=0, divergence_deg=0, bandwidth_nm=0)
    white = counted(instrument, lambert(), [10], np.arange(-80, 81, 10), 1)
    factor = calibration_factor(white, lambertian_standard(NM, [0.99] * 3, [0.0099] * 3))
    sample = facets(0.3, 0.0)
    counts = counted(IDEAL, sample, np.arange(20, 41, 1), np.arange(-60, 61, 1), 2, noisy=False)
    found = calibrate(counts, factor, repeatability_deg=0.1, tilt=Tilt())
    parts = found.brdf_stderr_by_source
    assert parts.source.values.tolist() == ["noise", "standard", "angle", "tilt"]
    np.testing.assert_allclose(np.sqrt((parts**2).sum("source")), found.brdf_stderr, rtol=1e-12)
    np.testing.assert_allclose(parts.sel(source="standard"), 0.01 * found.brdf, rtol=1e-9)
    # the derivatives in closed form, by a small step of the exact BRDF
    h = 1e-3
    g = {}
    for di, do in ((h, 0), (-h, 0), (0, h), (0, -h)):
        one = sampled(sample, found.theta_i + di, found.theta_o + do).brdf.values
        g[di, do] = one * np.cos(np.radians(found.theta_i.values + di))[:, None, None]
    cos = np.cos(np.radians(found.theta_i.values))[:, None, None]
    slope = np.hypot((g[h, 0] - g[-h, 0]) / (2 * h), (g[0, h] - g[0, -h]) / (2 * h)) * 0.1 / cos
    inner = np.s_[2:-2, 2:-2]
    np.testing.assert_allclose(parts.sel(source="angle").values[inner], slope[inner], rtol=0.02, atol=1e-5)


@pytest.mark.parametrize("sigma", [0.0, 0.1])
def test_error_of_the_factor_is_that_of_a_mean(sigma):
    """Four angles at ±3 %: spread 3 %·√(4/3) over √4; counts known to 10 % each, more than they spread: 10 %/√4."""
    angles = np.array([-60.0, -20.0, 20.0, 60.0])
    white = counted(IDEAL, lambert(1.0), [10], angles, 0, noisy=False)
    counts = white["counts"] * (1 + 0.03 * np.array([-1, 1, 1, -1]))[:, None]
    white = white.assign(counts=counts, counts_stderr=sigma * counts)
    factor = calibration_factor(white, lambertian_standard(NM, [1.0] * 3), theta_o_deg=angles)
    np.testing.assert_allclose(factor.factor, LAMP, rtol=1e-12)
    expected = 0.03 * np.sqrt(4 / 3) / 2 if sigma == 0 else 0.1 * np.sqrt(1 + 0.03**2) / 2
    np.testing.assert_allclose(factor.factor_stderr / factor.factor, expected, rtol=1e-9)
    found = calibrate(white.assign(counts_stderr=0 * counts), factor, repeatability_deg=0)
    np.testing.assert_allclose(found.brdf_stderr / found.brdf, np.full((1, 4, 3), expected), rtol=1e-9)


def test_one_angle_of_incidence_still_has_that_of_the_cosine():
    """f = g/cos θ_i: an error of the stage of 0.1° makes f tan θ_i · 0.1°, although no neighbour tells f's slope."""
    standard = counted(IDEAL, lambert(), [10], np.arange(-80, 81, 10), 0, noisy=False)
    factor = calibration_factor(standard, lambertian_standard(NM, [0.99] * 3))
    sample = counted(IDEAL, lambert(0.5), [60], np.arange(-60, 61, 5), 0, noisy=False)
    found = calibrate(sample, factor, repeatability_deg=0.1)
    part = found.brdf_stderr_by_source.sel(source="angle") / found.brdf
    np.testing.assert_allclose(part, np.tan(np.radians(60)) * np.radians(0.1), rtol=1e-9)


def test_tilt_of_the_first_configuration(facets):
    """4° and 8°: at normal incidence the mirror direction stays one, at 60° it is missed by 4°."""
    tilt = Tilt()
    wi, wo = tilt.directions(0.0, 0.0)
    np.testing.assert_allclose(wo, wi * [-1, -1, 1], atol=1e-12)
    wi, wo = tilt.directions(60.0, -60.0)
    missed = np.degrees(np.arccos(np.sum(wo * wi * [-1, -1, 1])))
    # elevations of the reflected beam, asin(cos 60° sin 8°) = 3.99°, and of the head, 8°
    assert missed == pytest.approx(8 - np.degrees(np.arcsin(0.5 * np.sin(np.radians(8)))), abs=0.02)
    theta_i, theta_o, azimuth = tilted_angles(60.0, 30.0, tilt)
    assert np.cos(np.radians(theta_i)) == pytest.approx(np.cos(np.radians(60)) * np.cos(np.radians(4)), rel=1e-12)
    # back-scattering is 8° away from the lamp: the detector does not shadow it
    wi, wo = tilt.directions(40.0, 40.0)
    assert np.degrees(np.arccos(wi @ wo)) == pytest.approx(8, abs=1e-6)
    assert theta_o > 30
    assert abs(azimuth) < 20
    np.testing.assert_allclose(tilt_effect(sampled(lambert(), [0, 40], np.arange(-70, 71, 10)), tilt), 0, atol=0.03)
    narrow = sampled(facets(0.05), [0, 40], np.arange(-70, 71, 1.0))
    effect = tilt_effect(narrow, tilt)
    mirror = np.flatnonzero(narrow.theta_o.values == -40)[0]
    assert (effect[1, mirror] < -0.1 * narrow.brdf.values[1, mirror]).all()  # the first configuration misses lobes


def test_bad_calibrations_are_refused():
    white = counted(IDEAL, lambert(), [10], np.arange(-80, 81, 10), 0, noisy=False)
    standard = lambertian_standard(NM, [0.99] * 3)
    with pytest.raises(InputError, match="no counts at θ_i = 30°"):
        calibration_factor(white, standard, theta_i_deg=30)
    with pytest.raises(InputError, match="no counts of the standard"):
        calibration_factor(white.where(False), standard)
    with pytest.raises(InputError, match="known from 450 to 650 nm, its BRDF is needed at 800 nm"):
        calibration_factor(white, standard, standard_nm=800)
    with pytest.raises(InputError, match="positive at every angle"):
        calibration_factor(-white, standard)
    with pytest.raises(InputError, match="counts over theta_i, theta_o, wavelength"):
        calibration_factor(white.rename(counts="v"), standard)
    factor = calibration_factor(white, standard)
    with pytest.raises(InputError, match="different wavelengths"):
        calibrate(white.isel(wavelength=[0, 1]), factor)
    with pytest.raises(InputError, match="not percent"):
        lambertian_standard(NM, [99.0] * 3)
    with pytest.raises(InputError, match="snr"):
        Spectrometer(snr=0)


def test_nist_ptfe_as_the_standard(shared):
    """Measured PTFE as standard for itself: the BRDF it was made from comes back at all angles.

    Calibrated at 533 nm against the whole in-plane BRDF; the round trip leaves the noise, below 0.2 %. Taken for a
    Lambertian of its reflectance instead, the factor would be off by what grazing angles lack.
    """
    ptfe = formats.read(shared / "data" / "nist_ptfe" / "PTFE.data.csv")
    brdf = isotropic(ptfe, "azimuth")
    instrument = Instrument(aperture_deg=0, divergence_deg=0, bandwidth_nm=0, repeatability_deg=0)
    seen = instrument.seen(brdf, [10, 40], np.arange(-70, 71, 10))
    white = instrument.counts(seen, 2e5, 0)
    factor = calibration_factor(white, ptfe, theta_o_deg=np.arange(-70, 71, 10), standard_nm=None)
    np.testing.assert_allclose(factor.factor, 2e5, rtol=1e-3)
    found = calibrate(white, factor)
    np.testing.assert_allclose(found.brdf, seen.brdf, rtol=0.01)
    assert abs(found.brdf / seen.brdf - 1).mean() < 2e-3
    # spread of the factor over angles when the standard is taken for a Lambertian: PTFE is not one
    flat = calibration_factor(white, lambertian_standard([532], [0.99]), standard_nm=532)
    spread = (flat.factor_by_angle / flat.factor).sel(wavelength=532)
    assert 0.03 < float(spread.max() - spread.min()) < 0.3


def test_spectralon_calibration_table(shared):
    nm, reflectance, uncertainty = read_reflectance(str(shared / "data" / "spectralon" / "Spectralon_Num4.txt"))
    assert (nm[0], nm[-1]) == (350, 2500)
    assert reflectance[0] == 0.9878
    assert uncertainty[0] == pytest.approx(0.0053 / 2)
    visible = (nm >= 360) & (nm <= 740)
    # the thesis: < 0.5 % from 360 to 740 nm; this standard varies as little
    assert reflectance[visible].std() < 0.005
    standard = lambertian_standard(nm, reflectance, uncertainty)
    white = IDEAL.counts(IDEAL.seen(lambert(0.99), [10], np.arange(-80, 81, 10)), LAMP, noisy=False)
    factor = calibration_factor(white, standard)
    np.testing.assert_allclose(factor.factor_standard / factor.factor, 0.0053 / 2 / 0.99, rtol=0.2)
    with pytest.raises(FileFormatError, match="no table"):
        read_reflectance(str(shared / "data" / "README.md"))


# ---- the virtual instrument
def test_lambert_stays_lambert_through_cones():
    """Averages of a constant: any aperture, divergence, bandwidth and tilt, to rounding."""
    instrument = Instrument(aperture_deg=5, divergence_deg=3, bandwidth_nm=20, tilt=Tilt(), spot_mm=1e-3)
    seen = instrument.seen(lambert(0.5), [0, 40, 80], [-85, -40, 0, 60, 85])
    np.testing.assert_allclose(seen.brdf, 0.5 / np.pi, rtol=1e-12)


def test_aperture_and_divergence_convolve_a_lobe():
    """A Gaussian in the half vector's slope, σ = 0.05: cones of half-angle a widen σ² by that of a disc, a²/4, each/4.

    ω_o moves the half vector by half its angle: σ² → σ² + (a_o² + a_i²)/16, the peak falls as 1/σ² (small angles).
    Rings of the quadrature: 1 %.
    """

    def lobe(sigma):
        def values(wi, wo):
            h = half_vectors(wi, wo)
            f = np.exp(-((h[:, 0] / h[:, 2]) ** 2 + (h[:, 1] / h[:, 2]) ** 2) / (2 * sigma**2)) / sigma**2
            return np.repeat(f[:, None], 3, axis=1)

        return IsotropicBrdf(NM, values, "")

    sigma, a, b = 0.05, np.radians(4.0), np.radians(3.0)
    instrument = Instrument(aperture_deg=8, divergence_deg=6, bandwidth_nm=0, spot_mm=1e-3)
    seen = instrument.seen(lobe(sigma), [0], [0]).brdf.values.ravel()
    wider = sigma**2 + (a**2 + b**2) / 16
    assert seen[0] == pytest.approx(1 / wider, rel=0.01)
    assert seen[0] < 0.85 / sigma**2


@pytest.mark.parametrize("side", [0, 1])
def test_each_cone_weighs_with_its_cosine(side):
    """f = 1/cos θ of one side: averaged with cos θ_i cos θ_o that is 1/⟨cos θ⟩ = 2/(cos 60° (1 + cos a)).

    The other side's cone changes nothing: which is which can be told.
    """
    brdf = IsotropicBrdf(NM, lambda wi, wo: np.repeat(1 / (wi, wo)[side][:, 2:], 3, axis=1), "")
    own, other = (("divergence_deg", "aperture_deg"), ("aperture_deg", "divergence_deg"))[side]
    wide = {own: 20.0, other: 6.0}
    seen = Instrument(bandwidth_nm=0, spot_mm=1e-3, **wide).seen(brdf, [60], [-60]).brdf
    np.testing.assert_allclose(seen, 2 / (0.5 * (1 + np.cos(np.radians(10)))), rtol=1e-12)


def test_a_simulated_result_through_the_instrument(facets):
    """A dataset at its own angles: without any effect it comes back, its lobe is flattened by the cones."""
    data = sampled(facets(0.1), [0, 30, 60], np.arange(-75, 76, 1.0))
    same = Instrument(aperture_deg=0, divergence_deg=0, bandwidth_nm=0).seen(data, fill="half-angle")
    np.testing.assert_allclose(same.brdf, data.brdf, rtol=0.01)
    blurred = Instrument(aperture_deg=6, divergence_deg=0, bandwidth_nm=0).seen(data, fill="half-angle")
    mirror = blurred.brdf.sel(theta_i=30, theta_o=-30) / data.brdf.sel(theta_i=30, theta_o=-30)
    assert (mirror < 0.97).all()
    assert (mirror > 0.7).all()
    with pytest.raises(InputError, match="other azimuths"):
        IDEAL.seen(data)
    with pytest.raises(InputError, match="theta_i_deg and theta_o_deg are needed"):
        IDEAL.seen(lambert())


def test_bandwidth_is_a_gaussian_line():
    """A Gaussian spectrum of width s seen with a line of width t: √(s² + t²); a linear one stays; 1 stays 1."""
    nm = np.arange(400, 701, 1.0)
    matrix = line_matrix(nm, 10.0)
    np.testing.assert_allclose(matrix.sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose((matrix @ nm)[30:-30], nm[30:-30], rtol=1e-9)
    s, t = 8.0, 10.0 / (2 * np.sqrt(2 * np.log(2)))
    wide = np.hypot(s, t)
    seen = matrix @ np.exp(-((nm - 550) ** 2) / (2 * s**2))
    np.testing.assert_allclose(seen, s / wide * np.exp(-((nm - 550) ** 2) / (2 * wide**2)), atol=1.5e-3)
    np.testing.assert_array_equal(line_matrix(nm, 0.0), np.eye(nm.size))


def test_spot_and_beam():
    """2.5 mm become 29 mm at 85° (thesis: about 30); while beam and sample are larger everything is lit."""
    instrument = Instrument()
    np.testing.assert_allclose(instrument.spot([0, 60, 85]), [2.5, 5, 28.68], rtol=1e-3)
    np.testing.assert_allclose(instrument.lit([0, 60, 80], [85, 85, 85]), 1, rtol=1e-12)
    # a beam as large as the spot at θ_i = 0: what is seen at θ_o is the disc of the beam, cos θ_o of the ellipse
    small = Instrument(spot_mm=2.5, beam_mm=2.5, sample_mm=50)
    np.testing.assert_allclose(small.lit(0, [0, 30, 60]), np.cos(np.radians([0, 30, 60])), rtol=2e-4)
    np.testing.assert_allclose(small.lit(60, 60), 1, rtol=1e-9)  # the beam's spot grows alike
    # a sample of half the spot's diameter: a quarter
    tiny = Instrument(spot_mm=2.5, sample_mm=1.25)
    assert float(tiny.lit(0, 0)) == pytest.approx(0.25, rel=2e-3)
    seen = tiny.seen(lambert(), [0], [0])
    assert float(seen.brdf[0, 0, 0]) == pytest.approx(0.25 * 0.99 / np.pi, rel=2e-3)


def test_noise_is_that_of_the_spectrometer():
    """1000:1 at full scale, full scale/85,000 without light; 100 averages are ten times better."""
    one, many = Spectrometer(), Spectrometer(averages=100)
    assert 2e5 / one.noise(2e5) == pytest.approx(1000, rel=1e-4)
    assert one.noise(0.0) == pytest.approx(2e5 / 85_000)
    np.testing.assert_allclose(many.noise([0, 1e3, 1e5]), one.noise([0, 1e3, 1e5]) / 10)
    instrument = Instrument(aperture_deg=0, divergence_deg=0, bandwidth_nm=0, repeatability_deg=0)
    seen = instrument.seen(lambert(), [0], np.linspace(-80, 80, 400))
    counts = instrument.counts(seen, LAMP, 5)
    mean = 0.99 / np.pi * LAMP
    spread = counts.counts.values[0].std(axis=0) / one.noise(mean)
    np.testing.assert_allclose(spread, 1, atol=4 / np.sqrt(2 * 400))
    with pytest.raises(InputError, match="full scale"):
        instrument.counts(seen, 1e7)
    with pytest.raises(InputError, match="aperture_deg"):
        Instrument(aperture_deg=-1)


def test_unit_vectors_of_an_untilted_stage():
    wi, wo = Tilt(0, 0).directions(30.0, -50.0)
    np.testing.assert_allclose(wi, unit_vectors(np.radians(30.0)), atol=1e-15)
    np.testing.assert_allclose(wo, unit_vectors(np.radians(-50.0)), atol=1e-15)
