# %% [markdown]
# # Calibrating a display
#
# A predicted colour is worth nothing if the display shows another. Here a wide-gamut headset is measured, described
# by a model, doubted, calibrated and verified, as one would do with a real one and a spectrometer. The headset is
# *virtual*: its faults are known, so that what is found can be held against what is there.

# %%
import tempfile
from pathlib import Path

import colour
import numpy as np

import vgonio as vg

vd = vg.display
scratch = tempfile.TemporaryDirectory()
folder = Path(scratch.name)

# %% [markdown]
# ## A display with faults
#
# Narrow bands of red, green and blue, 130 cd/m², and a tone curve of exponent 2.6. Its faults: *crosstalk* (2.2 % of
# the other channels' signal reaches a channel's own), *loading* (2 % of the light is lost when everything is on,
# because the supply gives way), *drift* (0.01 % in 100 readings) and the *noise* of the meter. `headset.measure`
# stands for a person who shows colours and reads spectra; from files it is `vd.read("readings.csv")`.

# %%
headset = vd.virtual_display(
    "wide-gamut", white_cd_m2=130, black_cd_m2=0.04, tone=2.6, seed=1,
    crosstalk=0.022, loading=0.02, drift=0.01, noise=0.005, floor=2e-7,
)  # fmt: skip
ramps = vd.ramp_colours(levels=18)  # each channel alone, black and white: what the model is fitted to
tests = vd.grid_colours(step=85)  # all combinations of four levels: what it is doubted with
readings = headset.measure(ramps)
doubts = headset.measure(tests, start=len(ramps))
print(f"{len(readings)} readings for the model, {len(doubts)} to test it, {readings.wavelength_nm.size} wavelengths")

# %% [markdown]
# ## The model
#
# The light of a colour is black plus three primaries of constant spectrum, each times the tone curve of its channel
# (thesis section 5.2). The curves are made to rise, so that they have an inverse: wanted colours become signals.

# %%
model = vd.fit(readings)
facts = vd.summary(model)
print(f"white {facts['white_cd_m2']:.1f} cd/m², contrast {facts['contrast']:.0f} : 1")
print(f"covers {facts['coverage']['sRGB']:.1%} of sRGB and {facts['coverage']['Adobe RGB']:.1%} of Adobe RGB (in u′v′)")
vg.report.display_figures.chromaticity_diagram({"headset": model})

# %% [markdown]
# The next figure shows white as measured beside the sum of black and the three primaries. The measured white is
# brighter by 4 %, because crosstalk adds more than loading takes away. The model cannot describe that.

# %%
vg.report.display_figures.white_spectra({"headset": model})

# %%
vg.report.display_figures.tone_curves({"headset": model})

# %% [markdown]
# ## Does the display obey the model?
#
# The 64 test colours as measured are compared with those that the model predicts, in ΔE₀₀ relative to the measured
# white. A difference of about 1 is just noticeable.

# %%
check = vd.check_model(model, readings, doubts)
vg.report.display_figures.delta_e_histogram({"headset": check})

# %% [markdown]
# The model takes four things for granted, and each can be tested by itself from the readings, without the fitted
# model: *constancy* (a primary has the same spectrum at all levels), *tone* (the curves go through levels that they
# were not fitted to), *independence* (a channel does not depend on a second one) and *additivity* (greys are the sum
# of their channels). The number is the mean ΔE₀₀ that breaking it costs. To see that the tests tell the faults apart,
# each fault is also tried by itself:

# %%
faults = {
    "none, but noise": {},
    "crosstalk 10 %": {"crosstalk": 0.10},
    "loading 15 %": {"loading": 0.15},
    "white sub-pixel 10 %": {"white_boost": 0.10},
    "bands wander 5 nm": {"shift_nm": 5.0},
}
costs = {"this headset": check.assumptions}
for name, fault in faults.items():
    patient = vd.virtual_display("wide-gamut", tone=2.6, seed=3, noise=0.002, **fault)
    costs[name] = vd.examine_virtual(patient)[0].check.assumptions

print(f"{'':22}" + "".join(f"{k:>14}" for k in check.assumptions.costs()))
for name, found in costs.items():
    print(f"{name:22}" + "".join(f"{v:13.2f}{'!' if v > 1 else ' '}" for v in found.costs().values()))

# %% [markdown]
# An exclamation mark means a mean ΔE₀₀ above 1. Crosstalk breaks independence and additivity, the two assumptions about
# several channels. Loading of 15 % and a white sub-pixel break additivity, and wandering bands break constancy and
# tone, the two assumptions about a single channel.
#
# ## Profile, table, verification
#
# The model is written as an ICC v4 profile and as a 3-D table for Adobe RGB images. Then 24 reflectance spectra of a
# ColorChecker under the display's white are shown in three ways: by their sRGB values, by their Adobe RGB values, and
# through the model.

# %%
vd.write_icc(folder / "headset.icc", model)
vd.write_cube(folder / "headset.cube", vd.lut(model, source="Adobe RGB", size=33), "Adobe RGB to this headset")

wanted = vd.targets(model, vd.patches("colorchecker"), bits=8)
shown = headset.measure(wanted.colours(), start=len(ramps) + len(tests))
calibration = vd.check_calibration(wanted, vd.looked_up(shown))
for way, numbers in calibration.statistics().items():
    print(f"{way:17} mean ΔE₀₀ {numbers['mean']:.2f}, largest {numbers['max']:.2f}")

# %% [markdown]
# The outer squares are the wanted colours and the inner ones the displayed colours. Only their difference is
# meaningful, because this page is not colour-managed.

# %%
vg.report.display_figures.patches(calibration)

# %% [markdown]
# ## The check
#
# The same is done a second way, with as little of vgonio as possible. The library colour-science reads the file of the
# table, applies it to 200 random Adobe RGB colours, decodes them to the colours that are meant, and computes ΔE₀₀
# itself. Only the headset with its faults is vgonio's.

# %%
rgb = np.random.default_rng(0).random((200, 3))
table = colour.io.read_LUT(str(folder / "headset.cube"))
ways = {"before": rgb, "after": np.clip(table.apply(rgb), 0, 1)}

adobe = colour.RGB_COLOURSPACES["Adobe RGB (1998)"]
d65 = colour.xy_to_XYZ(adobe.whitepoint)
to_xyz = colour.normalised_primary_matrix(adobe.primaries, adobe.whitepoint)
meant = colour.XYZ_to_Lab(adobe.cctf_decoding(rgb) @ to_xyz.T)
black, white = headset.measure([[0, 0, 0], [1, 1, 1]]).xyz

differences = {}
for name, signals in ways.items():
    seen = colour.XYZ_to_Lab((headset.measure(np.round(signals * 255) / 255).xyz - black) / (white - black) * d65)
    differences[name] = d = colour.delta_E(meant, seen, method="CIE 2000")
    print(f"{name:6} the table: mean ΔE₀₀ {d.mean():.2f}, 95 % below {np.percentile(d, 95):.2f}")

own = {way: numbers["mean"] for way, numbers in calibration.statistics().items()}
assert differences["after"].mean() < 1.3, "through the table colours arrive"
assert differences["after"].mean() < differences["before"].mean() / 3, "and without it they do not"
assert own["measured profile"] < 1.3 < own["Adobe RGB"] < own["sRGB"], "the patches say the same"
assert abs(check.statistics()["mean"] - 0.5) < 0.2, "the faults make the model error that they were chosen for"
assert costs["none, but noise"].failing() == [], "a display without faults passes"
assert costs["bands wander 5 nm"].costs()["independence"] < 0.1, "and a fault in the bands is not taken for another"
