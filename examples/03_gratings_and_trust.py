# %% [markdown]
# # Gratings, and which theory to trust
#
# A grating is the one rough surface for which everything is known: closed forms for the simple theories, and rigorous
# solutions of Maxwell's equations, whatever the depth. So it is the place to find out when a fast theory may be
# believed. This notebook begins with a sinusoid that has a closed form, goes on to a rigorous solver, finds out where
# three scalar theories fail, and ends by comparing the rigorous solver with an independent one.
#
# A grating of period P sends light into orders m at sin θ_o = −sin θ_i − mλ/P. Its *efficiency* is the share of the
# incident power that goes into each.

# %%
import csv

import numpy as np
import xarray as xr
from scipy.special import jv

import vgonio as vg
from vgonio.wave import trust

wavelength_nm = 550
theta_i = [0, 30, 60]
period_um = 3.2


def sinusoid(amplitude_um: float) -> vg.surface.Heightfield:
    """One row is enough: a profile, the same for all y."""
    return vg.surface.sinusoid(period_um, amplitude_um, shape=(1, 320), pitch_um=0.05)


# %% [markdown]
# ## 1. A theory with a formula
# Scalar theories take every point of the surface for a piece of its tangent plane and add up the reflected waves. Of a
# sinusoid z = a cos(2πx/P) that sum is a Bessel function: order m gets C² R J_m(q_z a)² / (cos θ_i cos θ_o), where q_z
# = k (cos θ_i + cos θ_o) is how much the phase changes with height and R the Fresnel reflectance at half the angle
# between ω_i and ω_o. The code knows nothing of Bessel functions: it integrates over the interpolated surface. On a
# perfect reflector, with Kirchhoff's C = (1 + ω_i·ω_o)/(cos θ_i + cos θ_o):

# %%
amplitude_um = 0.08
kirchhoff = vg.wave.Kirchhoff("perfect", wavelength_nm, tol=1e-6).orders(sinusoid(amplitude_um), theta_i)

cos_i, cos_o = np.cos(np.radians(kirchhoff.theta_i)), np.cos(np.radians(kirchhoff.theta_o))
sin_i, sin_o = np.sin(np.radians(kirchhoff.theta_i)), np.sin(np.radians(kirchhoff.theta_o))
k = 2 * np.pi / (wavelength_nm * 1e-3)
C = (1 + cos_i * cos_o + sin_i * sin_o) / (cos_i + cos_o)
bessel = C**2 * jv(kirchhoff.order, k * (cos_i + cos_o) * amplitude_um) ** 2 / (cos_i * cos_o)
formula_error = float(abs(kirchhoff.efficiency - bessel).max())
print(f"largest difference from the closed form: {formula_error:.0e} of the incident power")

# %% [markdown]
# ## 2. Three theories beside the rigorous solver
# Kirchhoff and the generalized and the original Harvey–Shack theory (GHS, OHS; the forms that are reciprocal) differ
# in C, and OHS in q_z, which it takes as 2k whatever the angle. The fourth is `FullWave`: boundary integral equations
# with all orders of scattering, on aluminium, for light polarised along the grooves (TE) and across (TM). It returns
# its own error and energy balance.

# %%
scalar = {
    "kirchhoff": vg.wave.Kirchhoff("Al", wavelength_nm, tol=1e-6),
    "generalized-harvey-shack": vg.wave.GeneralizedHarveyShack("Al", wavelength_nm, tol=1e-6),
    "harvey-shack": vg.wave.HarveyShack("Al", wavelength_nm, tol=1e-6),
}
full = vg.wave.FullWave("Al", wavelength_nm, tol=1e-4)

rigorous = full.orders(sinusoid(amplitude_um), theta_i)
print(f"error of the rigorous solver, by a coarser solution: {rigorous.attrs['error_achieved']:.0e}")
vg.report.plot_orders(
    {"full-wave": rigorous} | {name: solver.orders(sinusoid(amplitude_um), theta_i) for name, solver in scalar.items()}
)

# %% [markdown]
# At normal incidence Kirchhoff follows the rigorous solver over four decades; GHS and OHS leave it in the weak orders,
# far from the mirror direction. At 30° and 60° OHS goes wrong altogether: its q_z is too large by 1/cos θ, so it takes
# the grating for a deeper one. The black bars are what no scalar theory can tell apart, TE and TM.
#
# ## 3. How deep may it be?
# The error of a theory is Σ|scalar − rigorous| / Σ rigorous over the orders, rigorous being the mean of TE and TM. Now
# the amplitude grows from 10 nm, the RMS slope with it from 0.014 to 0.7; the dashed line is 5 %, where `vgonio plan`
# begins to warn.

# %%
amplitudes_um = np.geomspace(0.01, 0.5, 12)
slopes = xr.DataArray(
    np.sqrt(2) * np.pi * amplitudes_um / period_um,
    dims="slope",
    attrs={"long_name": "RMS slope of the sinusoid", "units": "1"},
)
rigorous_by_slope = [full.orders(sinusoid(a), theta_i) for a in amplitudes_um]


def errors(solver) -> xr.DataArray:
    """(theta_i, slope) of one theory."""
    found = [
        vg.compare.order_errors(r, solver.orders(sinusoid(a), theta_i))
        for a, r in zip(amplitudes_um, rigorous_by_slope)
    ]
    return xr.concat(found, "slope").squeeze("wavelength").assign_coords(slope=slopes)


by_theory = {name: errors(solver) for name, solver in scalar.items()}
vg.report.figures.theory_errors(by_theory)

# %%
for name, found in by_theory.items():
    for angle in theta_i:
        right = found.sel(theta_i=angle)
        wrong = right.where(right > 0.05, drop=True).slope
        holds = float(slopes.where(slopes < wrong.min()).max())
        print(f"{name:25} θ_i = {angle:2}°: within 5 % up to a slope of {holds:.2g}")

# %% [markdown]
# So Kirchhoff's theory is the one to take. It stays within 5 % up to a slope of a third at normal incidence, and up to
# an eighth at 60°, where GHS is as good. At normal incidence GHS is off by a few per cent more, and OHS should be used
# at normal incidence only. Beyond a slope of 0.4 none of the three is of use, because facets see each other;
# `IteratedKirchhoff` and `FullWave` are made for that.
#
# ## 4. Walls
# A lamellar grating has vertical walls, and no slope says how steep it is: tangent planes know nothing of walls. What
# counts is how many wavelengths they are apart.


# %%
def lamellar(period: float) -> vg.surface.Heightfield:
    return vg.surface.lamellar(period, depth_um=0.1, shape=(1, round(4 * period / 0.05)), pitch_um=0.05)


for period in (1.6, 3.2, 6.4):
    exact = full.orders(lamellar(period), theta_i)
    off = vg.compare.order_errors(exact, scalar["kirchhoff"].orders(lamellar(period), theta_i)).squeeze().values
    print(
        f"walls {period / 2 / 0.55:.1f} λ apart: Kirchhoff is off by "
        + ", ".join(f"{e:.0%} at {t}°" for e, t in zip(off, theta_i))
    )

# %%
vg.report.plot_orders(
    {"full-wave": full.orders(lamellar(3.2), theta_i), "kirchhoff": scalar["kirchhoff"].orders(lamellar(3.2), theta_i)}
)

# %% [markdown]
# Where ridges and grooves are equally wide, Kirchhoff's theory puts no power into the even orders; in truth the walls
# scatter light into them.
#
# ## 5. What vgonio says before it runs
# `vgonio plan` and `vgonio verdict` do not run the rigorous solver. They look up the most similar surfaces, by Sq,
# slope and angle, in tables of rigorous solutions: gratings (RCWA and the coordinate method, by other codes) and
# Gaussian profiles (the full wave). How good is that forecast on sinusoids that are not in the tables?

# %%
rows = []
for period, amplitude in ((2.4, 0.05), (3.2, 0.06), (5.0, 0.06)):
    grating = vg.surface.sinusoid(period, amplitude, shape=(1, round(4 * period / 0.05)), pitch_um=0.05)
    exact = full.orders(grating, theta_i)
    for name, solver in scalar.items():
        found = vg.compare.order_errors(exact, solver.orders(grating, theta_i)).squeeze()
        for angle in theta_i:
            forecast = trust.expected(name, *trust.equivalent_grating(grating), angle, wavelength_nm)
            rows.append((name, angle, period, forecast.error, float(found.sel(theta_i=angle))))
            if period == 3.2:
                least, likely, most = forecast.error
                forecast_text = f"{likely:6.1%} ({least:.1%} … {most:.1%})"
                print(f"{name:25} {angle:2}°: forecast {forecast_text}, found {rows[-1][-1]:6.1%}")

# %% [markdown]
# ## 6. The check
# 1. Kirchhoff's theory, computed over the surface, equals its closed form.
# 2. The rigorous solver keeps energy (reflected and absorbed power, each calculated by itself, add up to one) and is
#    reciprocal: an order has the same efficiency when the light is sent back along it.
# 3. It agrees with the *coordinate method* of Chandezon, another formulation in another code, on a sinusoid of the
#    table that comes with vgonio, per order and polarisation.
# 4. The forecast tells correctly on which side of 5 % an error lies.

# %%
assert formula_error < 1e-6, f"Kirchhoff is {formula_error:.0e} off its closed form"

balance = max(float(abs(r.energy_balance - 1).max()) for r in rigorous_by_slope)
assert balance < 1e-4, f"reflected and absorbed power add up to one only within {balance:.0e}"

steep = sinusoid(0.4)
there = full.orders(steep, [30]).sel(order=[-1, 1]).squeeze("wavelength")
reciprocity = 0.0
for m in (-1, 1):
    one = there.sel(order=m, theta_i=30)
    back = full.orders(steep, [float(one.theta_o)]).sel(order=m).squeeze()
    reciprocity = max(reciprocity, float(abs(back.efficiency - one.efficiency).max()))
assert reciprocity < 1e-4, f"an order and its way back differ by {reciprocity:.0e}"

with trust.FILE.open(encoding="utf-8", newline="") as file:
    lines = [line for line in csv.DictReader(file) if line["shape"] == "sinusoidal"]
chandezon: dict[tuple[float, ...], list[dict[str, str]]] = {}
for line in lines:
    key = tuple(float(line[column]) for column in ("depth_um", "period_um", "wavelength_um", "theta_i_deg"))
    chandezon.setdefault(key, []).append(line)
difference = 0.0
for (depth, period, wavelength, angle), orders in chandezon.items():
    same = vg.surface.sinusoid(period, depth / 2, shape=(1, 200), pitch_um=period / 200)
    ours = vg.wave.FullWave("Al:McPeak", wavelength * 1e3, tol=1e-4).orders(same, [angle]).squeeze().efficiency
    theirs = np.array([[float(line[p]) for p in ("TE", "TM")] for line in orders])
    numbers = [int(line["order"]) for line in orders]
    difference = max(difference, float(abs(ours.sel(order=numbers) - theirs).max()))
assert difference < 5e-6, f"the rigorous solver is {difference:.0e} off the coordinate method"

sides = [(row[3][1] > 0.05) == (row[4] > 0.05) for row in rows]
assert np.mean(sides) > 0.9, f"the forecast is on the right side of 5 % only in {sum(sides)} of {len(sides)} cases"

print(f"Kirchhoff against its closed form: {formula_error:.0e} of the incident power")
print(f"rigorous solver: energy within {balance:.0e}, order and way back within {reciprocity:.0e}")
print(f"the same against the coordinate method, {len(chandezon)} cases: {difference:.0e}, the digits of the table")
print(f"forecast on the right side of 5 %: {sum(sides)} of {len(sides)}")
