"""How far the diffraction efficiencies of two solvers are apart."""

from __future__ import annotations

import xarray as xr

from ..errors import InputError
from .metrics import labelled


def order_errors(reference: xr.Dataset, predicted: xr.Dataset) -> xr.DataArray:
    """Σ|predicted − reference| / Σ reference over the orders, (theta_i, wavelength), as in the table of `wave.trust`.

    reference, predicted : results of `orders` at the same angles and wavelengths; an order that one of them does not
    list carries nothing there. Polarisations are averaged, unless both have them: then the error is (…, polarisation).
    Raises InputError for results without efficiencies, and for other angles or wavelengths.
    """
    for name, data in (("reference", reference), ("predicted", predicted)):
        if "efficiency" not in data:
            raise InputError(
                f"{name} has no variable 'efficiency', but {', '.join(map(str, data))}: results of orders do"
            )
    r, p = reference["efficiency"], predicted["efficiency"]
    if not ("polarisation" in r.dims and "polarisation" in p.dims):
        r, p = (a.mean("polarisation") if "polarisation" in a.dims else a for a in (r, p))
    try:
        r, p = xr.align(r, p, join="exact", exclude={"order"})
    except ValueError as e:
        raise InputError(f"both have to be of the same angles and wavelengths (and polarisations): {e}") from None
    r, p = xr.align(r, p, join="outer", fill_value=0.0)
    return labelled(abs(p - r).sum("order") / r.sum("order"), "order_error", "1", "error of the efficiencies")
