# %% [markdown]
# # A roughness sweep
#
# When is a surface rough? There are two answers. To a wave it is rough when its heights are no longer small against
# the wavelength; to a ray only the slopes count. Here one scene is simulated for many heights σ and correlation
# lengths T at once (a *study*), and each answer is held against its law in closed form.

# %%
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.stats import poisson

import vgonio as vg

scratch = tempfile.TemporaryDirectory()
folder = Path(scratch.name)

# %% [markdown]
# ## A study: a scene and what varies in it
#
# The surfaces are Gaussian: normally distributed heights of RMS σ with the autocorrelation σ² exp(−r²/T²). A scene is
# one TOML file and a study another; in Python both are dictionaries. `vary` names keys of the scene, and every
# combination is a point. Three seeds of each surface are among them, so that their scatter is the error bar. The
# detector is a cone of 1.2° in the mirror direction (θₒ = −θᵢ).

# %%
surfaces = {"kind": "gaussian", "shape": [192, 192], "pitch_um": 0.3, "rms_um": 0.04, "correlation_um": 3}
scene = {
    "surface": {"generate": surfaces},
    "material": {"name": "perfect"},
    "light": {"wavelength_nm": [450, 650], "theta_i_deg": [0, 45], "coherence_um": 30},
    "detector": {"theta_o_deg": [-45, 0], "aperture_deg": 1.2},
}
smooth = {
    "title": "What a wave calls rough",
    "scene": scene | {"wave": {"theory": "kirchhoff", "tol": 1e-3}},
    "vary": {
        "surface.generate.rms_um": [0.01, 0.02, 0.04, 0.08],
        "surface.generate.correlation_um": [1.5, 3.0],
        "surface.generate.seed": [1, 2, 3],
    },
}

# %% [markdown]
# `sweep` runs the points on Dask: on a cluster of this machine with as many workers as processors (here one, which is
# as good for seconds of work), or with `scheduler="tcp://…"` on one that dask-jobqueue or Kubernetes started. Each
# worker stores its point at once. A killed run loses what was in flight, the same line goes on from there, and
# nothing finished is computed again. `vgonio sweep study.toml` does the same from the command line.

# %%
waves = vg.sweep(smooth, folder / "smooth", workers=1)
done = int((waves.state == 0).sum())
print(f"{done} of {waves.state.size} points done, over {dict(waves.state.sizes)}")
again = vg.sweep(smooth, folder / "smooth", workers=1)  # finds all points stored: no cluster is started
print("the same a second time:", again["waves"].brdf.identical(waves["waves"].brdf))

# %% [markdown]
# The result is one tree of xarray datasets over the swept dimensions: select by value, average over seeds.

# %%
print(dict(waves["waves"].brdf.sizes))
one = waves["waves"].brdf.sel(rms_um=0.04, correlation_um=3, theta_i=45, theta_o=-45, wavelength=650)
print("σ = 0.04 µm, mirror direction, three seeds:", one.values.round(), "sr⁻¹")

# %% [markdown]
# ## What a wave calls rough
#
# A height z delays the wave by a phase. Of normally distributed phases, RMS φ = 4πσ cos θᵢ/λ, the share exp(−φ²) of
# the light stays in step, and so in the mirror direction. The rest, 1 − exp(−φ²), is the *total integrated scatter*
# (Davies 1954, Bennett and Porteus 1961). T does not enter: it only says where the scattered light goes.
#
# As in the laboratory, a flat mirror in the same instrument gives the reference, "all the light". What the cone misses
# by comparison has been scattered.

# %%
gonio = vg.measure.Gonioreflectometer([0, 45], [-45, 0], aperture_deg=1.2, coherence_um=30)
flat = gonio.measure(vg.surface.flat(shape=(192, 192), pitch_um=0.3), vg.wave.Kirchhoff("perfect", [450, 650]))


def in_mirror_direction(brdf):
    """The BRDF at θₒ = −θᵢ, over theta_i."""
    return xr.concat([brdf.sel(theta_i=t, theta_o=-t, drop=True) for t in (0, 45)], flat.theta_i)


scattered = 1 - in_mirror_direction(waves["waves"].brdf) / in_mirror_direction(flat.brdf)
found = scattered.mean("generate_seed").assign_attrs(long_name="scattered share of the light", units="1")
error = scattered.std("generate_seed", ddof=1) / np.sqrt(3)

# %% [markdown]
# The cone catches some of the scattered light as well, and how much is known too: the scattered lobe is a sum over n
# = 1, 2, … of Gaussians, each √n times as wide as the first, with Poisson's weights (Beckmann and Spizzichino 1963).
# The law below is Davies' without what the cone catches, at most 7 % of the scattered light.

# %%
cosine = np.cos(np.radians(found.theta_i))
phase = 4 * np.pi * found.rms_um * cosine / (found.wavelength * 1e-3)
q = 2 * np.pi / (found.wavelength * 1e-3) * np.radians(0.6) * np.sqrt(cosine)  # rad/µm, at the cone's edge
n = xr.DataArray(np.arange(1, 60), dims="n")
law = (xr.apply_ufunc(poisson.pmf, n, phase**2) * np.exp(-((q * found.correlation_um / 2) ** 2) / n)).sum("n")

phase.attrs = {"long_name": "RMS phase 4πσ cos θᵢ / λ", "units": "1"}
vg.report.figures.agreement(found, law, error, along=phase, by="correlation_um")

# %% [markdown]
# Both correlation lengths, both wavelengths and both angles lie on one curve (two, where the cone catches some of the
# light). The same surface is a good mirror in red light and at oblique incidence, and a poor one in blue light from
# above.
#
# ## What a ray calls rough
#
# A ray is reflected at the facet it hits, so only slopes matter: α = √2 · (one-axis RMS slope) = 2σ/T for these
# surfaces. The same study is run once more for rougher surfaces, with rays in place of waves and with detectors from
# −80 to 80°.

# %%
directions = {"start": -80, "stop": 80, "step": 2.5}
rough = {
    "title": "What a ray calls rough",
    "scene": scene | {"detector": {"theta_o_deg": directions, "aperture_deg": 2.0}, "geometric": {"rays": 20_000}},
    "vary": smooth["vary"] | {"surface.generate.rms_um": [0.1, 0.2, 0.4]},
}
rays = vg.sweep(rough, folder / "rough", workers=1)
rays.vgonio.plot_sweep()

# %% [markdown]
# Left: on the steepest surfaces a seventh of the light is reflected twice or more often (solid T = 1.5 µm, dashed
# 3 µm). Middle: lobes widen with σ (one seed at T = 1.5 µm; jagged, because only few of its facets look into a cone of
# 2°). To put a number on the width, Beckmann's microfacet model is fitted to what is reflected once, since that is what
# such models are of. The scatter over the seeds is the error.

# %%
single = rays["rays"].to_dataset()
single = single.assign(brdf=single.brdf_by_bounce.sel(bounce=1))[["brdf"]]


def fitted_alpha(point):
    """α of the model's slopes for one surface, angles and wavelengths together."""
    return vg.compare.fit_model(point.squeeze(swept, drop=True), "beckmann-1963", material="perfect", starts=2).alpha


swept = ["rms_um", "correlation_um", "generate_seed"]
points = single.stack(point=swept)
alphas = [fitted_alpha(single.sel({k: [v] for k, v in zip(swept, values)})) for values in points.point.values]
alpha = xr.DataArray(np.array(alphas, float), dims="point", coords={"point": points.point}).unstack("point")
alpha.correlation_um.attrs = rays.correlation_um.attrs

mean = alpha.mean("generate_seed").assign_attrs(long_name="fitted slope α", units="1")
spread = alpha.std("generate_seed", ddof=1) / np.sqrt(3)
slope = 2 * mean.rms_um / mean.correlation_um
slope.attrs = {"long_name": "2σ/T", "units": "1"}
vg.report.figures.agreement(mean, slope, spread, along=slope, by="correlation_um")

# %% [markdown]
# ## The check
#
# Both laws are independent of the solvers. With only three seeds the error of each point is itself uncertain, so the
# test is on all points together: the mean square of (found − law)/error. To the error are added the numerical tolerance
# of the waves, 10⁻³ of the lobe, and 1 % for the rays, whose detector and facets are finite.

# %%
pulls = ((found - law) / np.hypot(error, 1e-3)).values
ray_pulls = ((mean - slope) / np.hypot(spread, 0.01 * slope)).values
for name, p in (("waves", pulls), ("rays", ray_pulls)):
    print(f"{name}: {p.size} points, RMS deviation {np.sqrt(np.mean(p**2)):.2f} errors, largest {np.abs(p).max():.1f}")
print(f"waves: largest deviation {float(abs(found - law).max()):.4f} of the light")
print(f"rays: largest deviation {float(abs(mean / slope - 1).max()):.1%} of α")
assert np.sqrt(np.mean(pulls**2)) < 2, "scattered light follows σ cos θᵢ/λ"
assert np.sqrt(np.mean(ray_pulls**2)) < 2, "the width of the rays' lobes follows σ/T"
