# %% [markdown]
# # Fitting the shift, and rendering it
#
# Blasted aluminium turns reddish in one direction and bluish in another: its spectrum is a little steeper or flatter
# than a mirror's, and the slope changes with the angles. Here a measured-like BRDF goes through the whole chain:
# local slopes, how much each explanation gives of them, a model with errors, and two spheres side by side. What was
# put in is known, so every step can be checked.

# %%
import importlib.util

import numpy as np

import vgonio as vg

# %% [markdown]
# ## Something like a measurement
#
# The truth is the shift-extended Cook–Torrance model (Clausen 2022, equation 4.8) on aluminium: facets with slopes of
# width α, times a factor that is linear in wavelength and 1 at 600 nm, with the slope m = h·cos(w·θₘ) (θₘ: between
# surface normal and half vector). Each value has 2 % of noise and says so. A real file would come from
# `vg.measure.read("sample.json")`.

# %%
truth = {"alpha": 0.35, "h": 8e-4, "w": 2.2}
clean = vg.models.evaluate(
    "clausen-2022", np.arange(0, 81, 10), np.arange(-80, 81, 5), np.arange(400, 721, 20), material="Al", **truth
)
noise = 1 + 0.02 * np.random.default_rng(7).standard_normal(clean.brdf.shape)
measured = clean.assign(brdf=clean.brdf * noise, brdf_stderr=0.02 * clean.brdf)
measured.attrs["method"] = "measured"
measured.vgonio.plot_spectra(theta_i_deg=60)

# %% [markdown]
# Left, around the mirror direction, the spectrum rises towards red; right, in back-scattering, it falls: some
# ten per cent to either side.
#
# ## Local slopes: what does the data say by itself?
#
# Each spectrum, divided by the Fresnel reflectance at its half-vector angle, is fitted with a straight line: its
# slope m in % per 100 nm. No model of how the slope depends on direction goes into that. The dashed line is the one
# function h·cos(w·θₘ) + t that is fitted to all of them.

# %%
measured.vgonio.plot_shift("Al")

# %% [markdown]
# ## Who explains it?
#
# Rays on a height field with the same slopes include the metal's colour and multiple reflections, and nothing else. The
# share of the measured slopes that an explanation gives is 1 − Σ(m − mₖ)²/Σm². The sums are weighted with the errors,
# whose own contribution is subtracted. A share of 1 is a full explanation, and "no shift" has a share of 0. To test the
# scale, a shift with half the true h is among the explanations: it has to explain 1 − (1 − ½)² = 75 %.

# %%
surface = vg.surface.sandblasted(shape=(320, 320), pitch_um=0.5, bead_diameter_um=(30, 45), depth_um=1.8, seed=2)
print(f"slopes of the height field: α = {vg.surface.parameters(surface)['alpha']:.3f}")
gonio = vg.measure.Gonioreflectometer(measured.theta_i, measured.theta_o, aperture_deg=4)
rays = gonio.measure(surface, vg.geometric.RayOptics("Al", measured.wavelength, rays=20_000))
half = vg.models.evaluate(
    "clausen-2022", measured.theta_i, measured.theta_o, measured.wavelength, material="Al", **truth | {"h": 4e-4}
)
shares = vg.compare.explained_shares(measured, {"rays": rays, "half the shift": half}, p=1.0)
vg.report.figures.explained(shares)

# %% [markdown]
# ## The models
#
# Cook–Torrance has α alone, the extended model α, h and w. Both are fitted under the thesis' logarithmic cost, which
# weighs dim and bright directions alike, and every parameter comes with its standard error. Noise here is independent
# from value to value, and `cluster="value"` says so; of a real instrument the spectrum as a whole (the default) or
# the angle of incidence is what is independent.

# %%
fits = {name: vg.compare.fit_model(measured, name, cluster="value") for name in ("cook-torrance-1982", "clausen-2022")}
for name, fit in fits.items():
    print(f"{name}: reduced χ² = {fit.chi2_reduced:.2f}, notes: {fit.notes}")
    for parameter in ("alpha", "h", "w"):
        if parameter in fit:
            value, error = float(fit[parameter]), float(fit[f"{parameter}_stderr"])
            print(f"  {parameter} = {value:.5g} ± {error:.1g} (true: {truth[parameter]:g})")

# %% [markdown]
# χ² near 1 says that the extended model leaves nothing but noise; without the shift something is missing. How much of
# it is seen:

# %%
vg.report.figures.models_beside(measured, fits)

# %% [markdown]
# ## Two spheres
#
# With the extra `render` (Mitsuba 3) both fits become materials: a sphere on a grey floor, under a spot and a
# directional light (thesis figure 4.13). Spectra are rendered at the wavelengths asked for; errors come from
# independent passes. Right: ΔE₀₀, of which 1 is just noticeable side by side.

# %%
spheres = [vg.render.of_fit(fit, name) for name, fit in fits.items()]
pictures = None
if importlib.util.find_spec("mitsuba"):
    pictures = vg.render.preview(spheres, vg.render.Preview(size=96, samples=6))
"not rendered: pip install 'vgonio[render]'" if pictures is None else vg.report.render_figures.previews(pictures)

# %% [markdown]
# ## The check
#
# - Fitted parameters lie within 4 of their stated errors of what was put in, and χ² is 1 to within its own scatter.
# - Half the shift explains three quarters of the slopes.
# - The renderer knows the model as a plug-in of its own. At the highlight the half vector is the normal, so the ratio
#   of both spheres has to be a line through 600 nm with the slope h: a path from fit to pixel that shares no code
#   with the fit.

# %%
best = fits["clausen-2022"]
pulls = {k: float((best[k] - truth[k]) / best[f"{k}_stderr"]) for k in truth}
print("(fitted − true)/error:", {k: round(v, 1) for k, v in pulls.items()})
assert max(map(abs, pulls.values())) < 4, "the stated errors hold"

scatter = np.sqrt(2 / measured.brdf.size)
without = fits["cook-torrance-1982"].chi2_reduced
print(f"χ² − 1 = {best.chi2_reduced - 1:+.3f}, its scatter {scatter:.3f}; without the shift χ² = {without:.1f}")
assert abs(best.chi2_reduced - 1) < 4 * scatter, "the extended model leaves noise alone"

quarter = shares.sel(explanation="half the shift")
print(f"half the shift explains {float(quarter.share):.3f} ± {float(quarter.share_stderr):.3f}, expected 0.75")
assert abs(quarter.share - 0.75) < 4 * quarter.share_stderr + 0.01, "shares are what they are said to be"

before, after = (float(vg.compare.delta_e_2000(measured, fits[n]).mean()) for n in fits)
noise_alone = float(vg.compare.delta_e_2000(measured, clean).mean())
print(f"mean ΔE₀₀ to the measurement: {before:.2f} without, {after:.2f} with shift; {noise_alone:.2f} is noise")
assert after < 1.05 * noise_alone < before, "with the shift only the noise is left to be seen"

if pictures is not None:
    y, x = np.unravel_index(pictures.tristimulus.sel(xyz="Y").values[0].argmax(), pictures.tristimulus.shape[1:3])
    plain, shifted = pictures.radiance.values[:, y, x]
    slope, level = np.polyfit(pictures.wavelength - 600, shifted / plain, 1)
    print(f"slope of the ratio at the highlight: {slope / level:.2e} per nm, h = {float(best.h):.2e}")
    assert abs(slope / level / float(best.h) - 1) < 0.1, "the renderer shows the shift that was fitted"
