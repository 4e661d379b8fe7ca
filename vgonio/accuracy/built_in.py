"""Speeds of a machine that was at hand, for plans on machines that are not calibrated. Made by `calibrate`."""

from .speeds import Speeds

MACHINE = "PROCESSOR, 2 processors"
BUILT_IN = {
    1: Speeds(
        facet=9.7e-07,
        ray=2.9e-07,
        hit=2e-06,
        point=1.9e-06,
        mueller=5.7e-08,
        height=2e-09,
        product=1.5e-10,
        line=8.5e-10,
        phase=8.9e-08,
        fft=3.4e-10,
        tap=3.9e-09,
        row=0.00061,
        spread=8.8e-08,
        space=0.37,
        plain_term=3.1e-08,
        term=4.9e-10,
        shadow=9.7e-09,
        vector=1.5e-07,
        kernel=0.85,
        flop=2.2e-11,
        profile_pair=4.1e-07,
        patch_pair=1.5e-08,
        far_term=3e-08,
        fixed={
            "start": (0.48, 1.1e08),
            "surface": (0.01, 3e06),
            "surface summary": (0.14, 1e07),
            "rays": (0.052, 9e06),
            "waves": (0.21, 6.7e07),
            "comparison": (0.61, 4.4e07),
            "save": (0.27, 3.1e07),
            "report": (1.3, 1.3e07),
        },
    ),
}
