"""Speeds of a machine that was at hand, for plans on machines that are not calibrated: what `calibrate` found there.

Other programs ran beside it: on a free machine two threads are up to twice as fast as their figures here.
"""

from .speeds import Speeds

MACHINE = "AMD EPYC, 2 processors, 2.6 GHz, of a cloud"
THREADS = (1, 2)
# by the threads of a run
SECONDS = {
    "facet": (9.8e-07, 9.3e-07),
    "ray": (3.1e-07, 3.1e-07),
    "hit": (2e-06, 2.3e-06),
    "point": (2.1e-06, 1.8e-06),
    "mueller": (7.8e-08, 5.5e-08),
    "height": (1.9e-09, 2.3e-09),
    "phase": (9e-08, 8.3e-08),
    "line": (7.7e-10, 1e-09),
    "product": (1.6e-10, 1.6e-10),
    "fft": (4.1e-10, 3.1e-10),
    "tap": (4.2e-09, 4.2e-09),
    "vector": (1.4e-07, 1.3e-07),
    "spread": (8.5e-08, 8.8e-08),
    "row": (0.00065, 0.0012),
    "space": (0.4, 0.55),
    "term": (4.7e-10, 4.5e-10),
    "plain_term": (3.1e-08, 9.4e-08),
    "shadow": (1e-08, 9.3e-09),
    "kernel": (0.61, 0.66),
    "flop": (2.1e-11, 4.7e-11),
    "profile_pair": (1.5e-07, 2.4e-07),
    "patch_pair": (1.9e-08, 2.6e-08),
    "far_term": (3e-08, 3e-08),
}
FIXED = {
    "start": ((0.49, 1.1e08), (0.54, 1.1e08)),
    "surface": ((0.01, 3e06), (0.0097, 3e06)),
    "surface summary": ((0.16, 1e07), (0.15, 1e07)),
    "rays": ((0.028, 7.4e06), (0.022, 7.3e06)),
    "waves": ((0.23, 6.7e07), (0.22, 6.7e07)),
    "comparison": ((0.7, 4.3e07), (0.71, 4.3e07)),
    "save": ((0.28, 3.1e07), (0.32, 3.1e07)),
    "report": ((1.3, 1.4e07), (1.6, 1.4e07)),
}
BUILT_IN = {
    threads: Speeds(**{k: v[i] for k, v in SECONDS.items()}, fixed={k: v[i] for k, v in FIXED.items()})
    for i, threads in enumerate(THREADS)
}
