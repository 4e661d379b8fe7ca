"""Mitsuba in the variants that work here."""

from __future__ import annotations

import pytest

pytest.importorskip("mitsuba", reason="Mitsuba is not installed: pip install vgonio[render]")


def in_variant(wanted: str):
    from vgonio.errors import BackendError
    from vgonio.render import use

    try:
        return use(wanted)
    except BackendError as e:
        pytest.skip(str(e))


@pytest.fixture(params=["scalar", "llvm"])
def mi(request):
    """Mitsuba in each variant that works here."""
    return in_variant(request.param)


@pytest.fixture
def llvm():
    return in_variant("llvm")


@pytest.fixture
def scalar():
    return in_variant("scalar")
