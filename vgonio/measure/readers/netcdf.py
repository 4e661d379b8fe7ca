"""A BRDF in a NetCDF-4 file of vgonio: a single dataset, or the group `measured` of a result."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from ...dataset import check
from ...errors import FileFormatError
from .. import storage
from .checks import Repairs


def sniff(head: bytes) -> bool:
    return head.startswith(b"\x89HDF\r\n\x1a\n")


def read(path: Path, repairs: Repairs) -> xr.Dataset:
    """The dataset of the root, of the group `measured`, or of the only group with a BRDF."""
    tree = storage.open(path)
    if "brdf" in tree.to_dataset():
        return check(tree.to_dataset(), str(path))
    groups = [name for name, node in tree.children.items() if "brdf" in node.to_dataset()]
    if "measured" in groups or len(groups) == 1:
        return check(tree["measured" if "measured" in groups else groups[0]].to_dataset(), str(path))
    found = (
        f"several BRDFs ({', '.join(groups)}): name one as FILE:GROUP, or open it with vgonio.open"
        if groups
        else "no BRDF"
    )
    raise FileFormatError(f"{path} holds {found}")
