"""Speeds of a machine that was at hand, for plans on machines that are not calibrated: what `calibrate` found there.

The better of two calibrations each, on a machine that did little else: on a busy one everything takes longer.
"""

from .speeds import Speeds

MACHINE = "AMD EPYC, 2 processors, 2.6 GHz, of a cloud"
THREADS = (1, 2)
# by the threads of a run
SECONDS = {
    "facet": (7.3e-07, 7.3e-07),
    "ray": (2.4e-07, 1.7e-07),
    "hit": (1.6e-06, 1.4e-06),
    "point": (1.5e-06, 1.7e-06),
    "mueller": (4e-08, 4.5e-08),
    "height": (1.5e-09, 1.6e-09),
    "phase": (5.5e-08, 7e-08),
    "line": (6.3e-10, 4.7e-10),
    "product": (7.6e-11, 9.7e-11),
    "fft": (1.7e-10, 1.7e-10),
    "tap": (3e-09, 3.1e-09),
    "vector": (1.2e-07, 1.2e-07),
    "spread": (7e-08, 6.5e-08),
    "row": (0.0005, 0.0007),
    "space": (0.28, 0.28),
    "term": (4e-10, 2.7e-10),
    "plain_term": (2.4e-08, 2.5e-08),
    "shadow": (6.6e-09, 6.8e-09),
    "kernel": (0.52, 0.51),
    "flop": (1.7e-11, 1.1e-11),
    "profile_pair": (1.1e-07, 1.5e-07),
    "patch_pair": (1.9e-08, 1e-08),
    "far_term": (3e-08, 3e-08),
}
FIXED = {
    "surface": (0.001, 0.001),
    "surface summary": (0.005, 0.005),
    "rays": (0.012, 0.012),
    "waves": (0.04, 0.04),
    "comparison": (0.075, 0.075),
    "save": (0.12, 0.12),
    "report": (0.95, 0.95),
}
LOADING = {
    "start": ((0.32, 1.1e08), (0.37, 1.1e08)),
    "surface": ((0.006, 3.1e06), (0.006, 3e06)),
    "surface summary": ((0.105, 1e07), (0.095, 1e07)),
    "rays": ((0.006, 7.4e06), (0.006, 7.3e06)),
    "waves": ((0.12, 6.7e07), (0.13, 6.7e07)),
    "comparison": ((0.38, 4.3e07), (0.4, 4.4e07)),
    "save": ((0.1, 3.1e07), (0.09, 3.1e07)),
    "report": ((0.03, 1.4e07), (0.03, 1.4e07)),
}
BUILT_IN = {
    threads: Speeds(
        **{k: v[i] for k, v in SECONDS.items()},
        fixed={k: v[i] for k, v in FIXED.items()},
        loading={k: v[i] for k, v in LOADING.items()},
    )
    for i, threads in enumerate(THREADS)
}
