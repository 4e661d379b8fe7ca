# %% [markdown]
# # A first BRDF
#
# A blasted aluminium surface, its scattering by rays and by waves.

# %%
import numpy as np

import vgonio as vg

surface = vg.surface.sandblasted(shape=(256, 256), pitch_um=0.5, seed=1)
vg.report.plot_surface(surface)

# %% [markdown]
# ## The check

# %%
assert np.isfinite(surface.z).all(), "a made surface has no missing points"
print("the check passes: no point is missing")
