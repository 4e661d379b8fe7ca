# %% [markdown]
# # A first BRDF
#
# How does a rough metal scatter light, and how far can the answer be trusted? This notebook makes a surface, shines
# light on it in two ways, by rays and by waves, and holds the two against each other and against what has to be true.
#
# The quantity in question is the *bidirectional reflectance distribution function*: radiance that leaves towards ω_o
# over irradiance that arrives from ω_i, in sr⁻¹. Angles are signed and in degrees: the mirror direction is θ_o = −θ_i,
# light that goes back to its source has θ_o = θ_i. Lengths on the surface are in µm, wavelengths in nm.

# %%
import numpy as np

import vgonio as vg

# %% [markdown]
# ## 1. A surface
# Glass beads have hit aluminium at random places and left spherical cavities. Two numbers say most about how it will
# look: Sq, the RMS height, decides whether there is any mirror-like peak left (none, where Sq is above a quarter of a
# wavelength or so), and α, √2 times the RMS slope along one axis, how wide the lobe is. The field is periodic, so it
# has no edges.

# %%
surface = vg.surface.sandblasted(shape=(320, 320), pitch_um=0.5, bead_diameter_um=(30, 45), depth_um=1.8, seed=2)
found = vg.surface.parameters(surface)
print(f"{surface.size_um[0]:g} µm × {surface.size_um[1]:g} µm, Sq = {found['Sq']:.2f} µm, α = {found['alpha']:.3f}")
vg.report.plot_surface(surface)

# %% [markdown]
# ## 2. An instrument
# A gonioreflectometer is a source and a detector on two arms. The detector sees a cone, here of 4° full angle, and so
# does the virtual one: the BRDF is the power in the cone over the incident power and the cone's projected solid angle.
# Light is coherent over a patch of ℓ = 12 µm; that matters for waves alone.

# %%
gonio = vg.measure.Gonioreflectometer(
    theta_i_deg=[0, 30, 60], theta_o_deg=range(-80, 81, 5), aperture_deg=4.0, coherence_um=12
)
wavelength_nm = range(400, 701, 50)

# %% [markdown]
# ## 3. Rays
# Each facet is a small mirror. A ray is reflected, loses the power that the Fresnel equations of aluminium say, and may
# hit the surface again. All wavelengths share one trace. The standard error comes from the number of rays that the
# detector caught.

# %%
rays = gonio.measure(surface, vg.geometric.RayOptics("Al", wavelength_nm, rays=300_000, seed=1))
rays.vgonio.plot_decomposition()

# %% [markdown]
# Dark blue is light that was reflected once. Multiple reflections grow with the angle of incidence: at 60° they make
# up to a sixth of the BRDF. Hatched bins caught too few rays to be split. The next figure shows where the energy goes.
# What leaves, what is absorbed and what is lost are counted separately, and none of them as one minus the others, so
# that their sum is a check:

# %%
rays.vgonio.plot_energy()

# %% [markdown]
# ## 4. Waves
# Kirchhoff's approximation (Beckmann and Spizzichino 1963) takes the surface at every point for its tangent plane, and
# sums the reflected fields over the coherent patch with all their phases. One patch gives speckle, not a BRDF. So
# patches tile the surface: their mean is the BRDF, and their spread gives its standard error. The theory knows single
# reflections only, and no shadows.

# %%
waves = gonio.measure(surface, vg.wave.Kirchhoff("Al", wavelength_nm, tol=1e-3))
both = {"rays": rays, "waves": waves}
vg.report.plot_lobes(both)

# %% [markdown]
# The bands are ± one standard error. Two errors are *not* in them: what a theory leaves out, and that another piece of
# the same sample would look different. Both methods see the same facets, so for the most part they agree better than
# the bands suggest. In the mirror direction they do not: the beads left a few flats, and these are mirrors a few µm
# wide. Rays reflect all of their light into one direction; waves spread it by diffraction, red light more than blue. At
# 60° the rays include multiple reflections and shadows, which this wave theory lacks.
#
# ## 5. Colour
# Under daylight (CIE D65, 2° observer) every pair of directions has a colour. Aluminium is nearly neutral, and so are
# the colours by rays. By waves the flats are bluish in the mirror direction, because diffraction spreads red
# light more. The rest of the colour of the waves is speckle, which differs from one wavelength to the next. On so small
# a sample a difference of a few ΔE₀₀ therefore means nothing, although a difference of about 1 is just noticeable.

# %%
vg.report.plot_rgb(both)

# %%
vg.report.plot_delta_e(waves, reference=rays)

# %% [markdown]
# ## 6. The check
# Three statements have to be true, and none of them is built into the code:
#
# 1. The three tallies of energy add up to one.
# 2. At normal incidence nearly all light is reflected once, near normal incidence on the facets: the reflected share
#    is that of a flat mirror, |(n + ik − 1)/(n + ik + 1)|².
# 3. Rays and waves, two theories with hardly a line of code in common, agree within their errors where neither shadows
#    nor second reflections nor flats count: up to 30° of incidence, over a factor of 100 in brightness, but for the
#    mirror direction.

# %%
total = rays.energy_by_bounce.sum("bounce") + rays.energy_absorbed + rays.energy_lost
off = float(abs(total - 1).max())
assert off < 1e-9, f"the tallies add up to {1 + off}"

index = vg.materials.material("Al").index(550)
flat = abs((index - 1) / (index + 1)) ** 2
reflected = float(rays.energy_by_bounce.sel(theta_i=0, wavelength=550).sum())
assert abs(reflected - flat) < 2e-3, f"reflected {reflected:.4f}, a flat mirror {flat:.4f}"

near = {name: data.sel(theta_i=[0, 30]) for name, data in both.items()}
bright = near["rays"].brdf > 1e-2 * near["rays"].brdf.max("theta_o")
bright &= near["rays"].theta_o != -near["rays"].theta_i
apart = abs(near["waves"].brdf - near["rays"].brdf)
error = np.hypot(near["waves"].brdf_stderr, near["rays"].brdf_stderr)
within = float((apart < 2 * error).where(bright).mean())
typical = float((apart / near["rays"].brdf).where(bright).median())
assert within > 0.9, f"only {within:.0%} of the values agree within two standard errors"
assert typical < 0.15, f"rays and waves differ by {typical:.0%} in the median"

print(f"energy: the tallies add up to 1 within {max(off, 1e-15):.0e}")
print(f"reflected at normal incidence: {reflected:.4f}, a flat mirror of n + ik = {index:.3f}: {flat:.4f}")
print(f"rays and waves: {within:.0%} within two standard errors, median difference {typical:.1%}")
