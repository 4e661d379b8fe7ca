"""The page to explore a result: its numbers are the result's, and a browser shows what its controls ask for."""

from __future__ import annotations

import base64
import html
import json
import re
import subprocess

import numpy as np
import pytest
import xarray as xr

from vgonio.cli import main
from vgonio.errors import InputError
from vgonio.measure import save
from vgonio.report import explorer_page
from vgonio.report import quantities as q
from vgonio.report.content import Content
from vgonio.report.explorer import render_explorer
from vgonio.report.explorer_data import UNKNOWN, embedded, plane_elements, thinned


def decoded(text: str, kind: str = "<f4") -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), kind)


def data_of(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S).group(1))


@pytest.fixture(scope="module")
def hemisphere(hemisphere_rays, hemisphere_waves) -> xr.DataTree:
    return xr.DataTree.from_dict({"rays": hemisphere_rays, "waves": hemisphere_waves}, name="a hemisphere")


def test_numbers_on_the_page_are_the_results(full_result):
    found = data_of(render_explorer(full_result))
    assert [r["name"] for r in found["results"]] == ["rays", "waves", "measured"]
    for r in found["results"]:
        data = q.results(full_result)[r["name"]]
        brdf = decoded(r["brdf"]).reshape(len(r["theta_i"]), r["detectors"], len(r["wavelength"]))
        np.testing.assert_array_equal(brdf, data["brdf"].values.astype(np.float32))  # NaN where nothing was measured
        assert bool(r["error"]) == ("brdf_stderr" in data)
    rays = found["results"][0]
    shares, trusted = q.bounce_shares(full_result["rays"].to_dataset())
    steps = decoded(rays["bounces"]["shares"], "u1").reshape(shares.shape)
    assert ((steps == UNKNOWN) == ~trusted.values[None]).all()
    known = np.broadcast_to(trusted.values[None], shares.shape)
    assert np.abs(steps[known] / 254 - shares.values[known]).max() <= 0.5 / 254 + 1e-12


def test_colours_are_those_of_the_map(full_result):
    from vgonio.compare.colour import rgb_map

    for r in embedded(Content.of(full_result))["results"]:
        linear = decoded(r["rgb"]).reshape(len(r["theta_i"]), -1, 3) * r["exposure"]
        clipped = np.clip(linear, 0, 1).astype(float)
        encoded = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(encoded, rgb_map(q.results(full_result)[r["name"]]).values, atol=1e-5)


def test_plane_of_a_hemisphere(hemisphere_rays):
    signed, index = plane_elements(hemisphere_rays)
    assert (np.diff(signed) > 0).all()
    np.testing.assert_allclose(np.abs(signed), hemisphere_rays["theta_o"].values[index])
    # the cells that the plane cuts: their azimuth is within half a cell of 0° or 180°
    azimuth = hemisphere_rays["phi_o"].values[index]
    expected = np.where(signed >= 0, 0.0, 180.0)
    ring = np.array([(np.abs(hemisphere_rays["theta_o"].values - abs(t)) < 1e-5).sum() for t in signed])
    away = np.abs((azimuth - expected + 180) % 360 - 180)
    assert (away[signed != 0] <= 180.0 / ring[signed != 0] + 1e-9).all()


def test_of_too_much_some_is_left_out_and_said(ray_result):
    data, note = thinned(ray_result, 10**9)
    assert data is ray_result
    assert note == ""
    fine = ray_result.interp(wavelength=np.arange(380, 781, 5.0))
    less, note = thinned(fine, 81 * fine.sizes["theta_i"] * fine.sizes["theta_o"] * 8)
    assert less.sizes["wavelength"] == 41
    assert note == "41 of 81 wavelengths are on this page"
    np.testing.assert_array_equal(less["wavelength"], fine["wavelength"][::2])


def test_page_needs_nothing_else_and_is_small(full_result, tmp_path):
    path = explorer_page(full_result, tmp_path / "explore.html")
    text = path.read_text(encoding="utf-8")
    assert path.stat().st_size < 400_000
    assert "http" not in text
    assert not re.search(r'(src|href)="', text)
    ids = re.findall(r'\bid="([^"]+)"', text[: text.index("<script")])
    assert len(ids) == len(set(ids))
    for label in re.findall(r'<label for="([^"]+)"', text):
        assert label in ids


def test_a_title_cannot_break_out(full_result):
    bad = full_result.copy()
    bad.attrs["title"] = "</script><script>alert(1)</script>"
    bad["waves"].attrs["theory"] = "</script><b>"
    text = render_explorer(bad)
    assert text.count("<script") == 2
    assert data_of(text)["results"][1]["title"] == "Waves (</script><b>)"


def test_what_cannot_be_explored_is_refused(full_result):
    with pytest.raises(InputError, match="nothing to explore"):
        render_explorer(xr.DataTree())
    twice = full_result["waves"].to_dataset().expand_dims(sigma=2)
    with pytest.raises(InputError, match="sigma cannot be explored: select one"):
        render_explorer(xr.DataTree.from_dict({"waves": twice}))


def test_command(full_result, tmp_path, capsys):
    path = save(full_result, tmp_path / "r.nc")
    assert main(["explore", str(path)]) == 0
    assert (tmp_path / "r_explore.html").is_file()
    assert "r_explore.html" in capsys.readouterr().out
    assert main(["explore", str(path), "-o", str(tmp_path / "r.txt")]) == 2
    assert not (tmp_path / "r.txt").exists()
    full_result.vgonio.explore(tmp_path / "again.html")
    assert (tmp_path / "again.html").read_text() == (tmp_path / "r_explore.html").read_text()


# ---- in a browser
# moves the controls as a user does, looks, and writes what it saw into the title
PROBE = """<script>
addEventListener("load", () => {
  const set = (id, v) => { const e = document.getElementById(id); e.value = v; e.dispatchEvent(new Event("input")); };
  const seen = {values: []};
  const look = () => seen.values.push({
    out: ["ti", "nm", "to"].map(k => document.getElementById(k + "-out").textContent),
    rows: [...document.querySelectorAll("#values tr")].map(r => [...r.children].map(c => c.textContent)),
    lobe: [...document.querySelectorAll("#lobe path.curve")].map(p => p.getAttribute("d").length),
    squares: document.querySelectorAll("#maps rect:not(.chosen)").length, hash: location.hash,
  });
  window.requestAnimationFrame = f => f();  // at once: no waiting for pictures that nobody sees
  look();
  for (const [ti, nm, to] of STEPS) { set("ti", ti); set("nm", nm); set("to", to); look(); }
  document.getElementById("back").click(); look();
  const ink = c => new Set(new Uint32Array(c.getContext("2d").getImageData(0, 0, c.width, c.height).data.buffer)).size;
  const colours = () => [...document.querySelectorAll("canvas")].map(ink);
  seen.canvas = colours();
  const quantity = document.getElementById("quantity");
  if (quantity) { quantity.value = "bounces"; quantity.dispatchEvent(new Event("change")); seen.shares = colours(); }
  const map = document.querySelector("#maps svg");
  if (map) {
    const box = map.getBoundingClientRect();
    const at = {clientX: box.left + box.width * (34 + 160) / 360, clientY: box.top + box.height * 200 / 246};
    map.dispatchEvent(new MouseEvent("click", {bubbles: true, ...at})); look();
  }
  document.querySelector("#shown input").click();
  look();
  const wide = document.documentElement.scrollWidth;
  seen.fits = wide <= innerWidth;
  seen.focusable = [...document.querySelectorAll("input, select, button")].every(e => e.disabled || e.tabIndex >= 0);
  const named = e => e.labels?.length || e.textContent.trim() || e.getAttribute("aria-label");
  seen.named = [...document.querySelectorAll("input, select, button")].every(named);
  const box = e => e.getBoundingClientRect();
  seen.outside = [...document.querySelectorAll(".panel svg text")].filter(t => {
    const f = box(t.closest("svg")), b = box(t);
    return b.left < f.left - 2 || b.right > f.right + 2 || b.top < f.top - 2 || b.bottom > f.bottom + 2;
  }).map(t => t.textContent);
  seen.requests = performance.getEntriesByType("resource").map(r => r.name).filter(n => !n.startsWith("data:"));
  document.title = JSON.stringify(seen);
});
addEventListener("error", e => console.error("page error: " + e.message), true);
</script></head>"""


def seen_in_browser(browser, path, folder, width, steps, address=""):
    probe = PROBE.replace("STEPS", json.dumps(steps))
    path.write_text(path.read_text(encoding="utf-8").replace("</head>", probe, 1), encoding="utf-8")
    command = [*browser, f"--user-data-dir={folder / 'p'}", f"--window-size={width},900", path.as_uri() + address]
    run = subprocess.run(command, capture_output=True, text=True, timeout=600, check=True)
    assert [line for line in run.stderr.splitlines() if "CONSOLE" in line] == []
    title = re.search(r"<title>(\{.*?\})</title>", run.stdout, re.S)
    assert title, "the page did not finish loading"
    return json.loads(html.unescape(title.group(1)))


def shown(text: str) -> float:
    text = text.replace("−", "-").replace("·10", "e").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    return float(text) if text != "–" else float("nan")


@pytest.mark.parametrize("width", [1280, 500])
def test_page_in_a_browser(browser, full_result, tmp_path, width):
    path = explorer_page(full_result, tmp_path / "page.html")
    steps = [[0, 0, 0], [3, 5, 4], [4, 10, 16]]
    seen = seen_in_browser(browser, path, tmp_path, width, steps, "#ti=20&nm=620&to=30&log=0")
    results = q.results(full_result)
    first, *moved, back, clicked, hidden = seen["values"]
    assert first["out"] == ["20°", "620 nm", "30°"]
    rays = results["rays"]
    grid = [rays[k].values for k in ("theta_i", "wavelength", "theta_o")]
    at = [(20.0, 620.0, 30.0)] + [tuple(g[k] for g, k in zip(grid, s)) for s in steps]
    at += [(80.0, 780.0, 80.0)]  # "to back-scattering"
    for view, (theta_i, nm, theta_o) in zip([first, *moved, back], at):
        assert len(view["rows"]) == 3
        for row, data in zip(view["rows"], results.values()):
            here = data.sel(theta_i=theta_i, wavelength=nm, theta_o=theta_o)
            # three or four digits are shown; float32 ends at 1e-45
            np.testing.assert_allclose(shown(row[1]), float(here["brdf"]), rtol=6e-3, atol=1e-45)
            if "brdf_stderr" in data:
                np.testing.assert_allclose(shown(row[2]), float(here["brdf_stderr"]), rtol=6e-3, atol=1e-45)
        share, trusted = q.bounce_shares(rays.sel(theta_i=theta_i, wavelength=nm, theta_o=theta_o))
        single = shown(view["rows"][0][3].removesuffix(" %"))
        assert np.isnan(single) if not trusted else abs(single - 100 * float(share[0])) <= 0.25
        assert len(view["lobe"]) >= 3
        assert f"ti={theta_i:g}&nm={nm:g}&to={theta_o:g}" in view["hash"]
    # a click into the bottom row of the first map, in the middle
    assert clicked["out"] == ["0°", "780 nm", "0°"]
    assert first["squares"] == 3 * rays.sizes["theta_i"] * rays.sizes["theta_o"]
    assert len(hidden["rows"]) == 2
    assert hidden["squares"] == first["squares"] * 2 // 3
    assert "hide=rays" in hidden["hash"]
    assert seen["fits"]
    assert seen["focusable"]
    assert seen["named"]
    assert seen["outside"] == []
    assert seen["requests"] == []


def test_hemisphere_in_a_browser(browser, hemisphere, tmp_path):
    path = explorer_page(hemisphere, tmp_path / "page.html")
    seen = seen_in_browser(browser, path, tmp_path, 500, [[1, 1, 3]])
    rays = hemisphere["rays"].to_dataset()
    signed, index = plane_elements(rays)
    here = rays.sel(theta_i=30, wavelength=550).isel(cell=index[3])
    np.testing.assert_allclose(shown(seen["values"][1]["rows"][0][1]), float(here["brdf"]), rtol=6e-4)
    assert shown(seen["values"][1]["out"][2].removesuffix("°")) == pytest.approx(signed[3], abs=0.005)
    # lobes of many shades, and shares of the rays; the waves have none, so that map is of one shade and its marks
    assert len(seen["canvas"]) == 2
    assert min(seen["canvas"]) > 60
    assert seen["shares"][0] > 40
    assert seen["shares"][1] < seen["shares"][0]
    assert seen["fits"]
    assert seen["outside"] == []
