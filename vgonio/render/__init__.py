"""5. Use it: Mitsuba plug-ins of the models, previews of materials, and the Normbox (thesis 4.5 and chapter 3).

Importing this package does not load Mitsuba; the functions that render do, and say which extra is missing.
"""

from .appearance import Appearance, of_dataset, of_fit, of_model, of_table
from .bsdf import EXTENDED, PLAIN, register
from .preview import Preview, delta_e, preview, rgb
from .spectral import in_passes, radiance
from .variants import Choice, choose, use

__all__ = [
    "EXTENDED",
    "PLAIN",
    "Appearance",
    "Choice",
    "Preview",
    "choose",
    "delta_e",
    "in_passes",
    "of_dataset",
    "of_fit",
    "of_model",
    "of_table",
    "preview",
    "radiance",
    "register",
    "rgb",
    "use",
]
