"""How accurate, and how long: every solver on cases whose answer is known, asked and achieved error beside the seconds.

>>> from vgonio.accuracy import run_cases
>>> table = run_cases(["sinusoid-nufft", "v-groove"])
"""

from .cases import CASES, Case, Outcome
from .measuring import machine, run_cases, select

__all__ = ["CASES", "Case", "Outcome", "machine", "run_cases", "select"]
