"""Sweeps: one scene, many values of its keys, every finished point stored at once and never computed again.

>>> from vgonio.studies import load_study, sweep
>>> tree = sweep("study.toml")
"""

from .forecast import StudyPlan, plan_study
from .gathering import gather
from .store import Store
from .study import Study, load_study
from .sweeping import sweep

__all__ = ["Store", "Study", "StudyPlan", "gather", "load_study", "plan_study", "sweep"]
