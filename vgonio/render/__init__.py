"""5. Use it: Mitsuba plug-ins of the models, previews of materials, and the Normbox (thesis 4.5 and chapter 3).

Importing this package does not load Mitsuba; the functions that render do, and say which extra is missing.
"""

from .bsdf import EXTENDED, PLAIN, register
from .spectral import in_passes, radiance
from .variants import Choice, choose, use

__all__ = [
    "EXTENDED",
    "PLAIN",
    "Choice",
    "choose",
    "in_passes",
    "radiance",
    "register",
    "use",
]
