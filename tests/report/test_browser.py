"""The page in a real browser, as wide as a laptop's and a phone's: every picture is there, nothing sticks out."""

from __future__ import annotations

import base64
import io
import json
import re
import subprocess

import pytest
from PIL import Image

from vgonio.report import page

# what a reader's browser knows after loading, written into the page's title; pictures are decoded in Python: on a busy
# machine they take longer than the browser's virtual time runs
PROBE = """<script>
addEventListener("load", () => {
  const box = e => e.getBoundingClientRect();
  const inner = [...document.querySelectorAll("svg image")];
  const pictures = inner.map(e => Object.assign(new Image(), {src: e.href.baseVal})).concat([...document.images]);
  const figures = [...document.querySelectorAll("svg.figure")];
  const text = [...document.querySelectorAll("svg.figure text")];
  document.title = JSON.stringify({
    pictures: pictures.map(p => decodeURI(p.src).replace(/\\s/g, "").length),
    figures: figures.map(f => [box(f).width, box(f).height, f.querySelectorAll("path, image").length]),
    wide: document.documentElement.scrollWidth, window: innerWidth,
    outside: text.filter(t => {
      const f = box(t.closest("svg")), b = box(t);
      return b.width && (b.left < f.left - 2 || b.right > f.right + 2 || b.top < f.top - 2 || b.bottom > f.bottom + 2);
    }).map(t => t.textContent),
    requests: performance.getEntriesByType("resource").map(r => r.name).filter(n => !n.startsWith("data:")),
  });
});
addEventListener("error", e => console.error("page error: " + e.message), true);
</script></head>"""


def embedded_pictures(text: str) -> list[str]:
    """The data addresses of a page's pictures as a browser takes them, without line breaks; each decodes."""
    found = [re.sub(r"\s", "", p) for p in re.findall(r'="(data:image/png;base64,[^"]+)"', text)]
    assert found
    for picture in found:
        image = Image.open(io.BytesIO(base64.b64decode(picture.partition(",")[2], validate=True)))
        image.load()
        assert min(image.size) > 1
    return found


@pytest.fixture(scope="module")
def probed(tmp_path_factory, full_result):
    """A page of everything, with a script that looks at it."""
    path = page(full_result, tmp_path_factory.mktemp("page") / "page.html")
    path.write_text(path.read_text(encoding="utf-8").replace("</head>", PROBE, 1), encoding="utf-8")
    return path


@pytest.mark.parametrize("width", [1280, 500])
def test_page_loads_in_a_browser(browser, probed, tmp_path, width):
    command = [*browser, f"--user-data-dir={tmp_path}", f"--window-size={width},900", probed.as_uri()]
    run = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stderr[-2000:]
    complaints = [line for line in run.stderr.splitlines() if "CONSOLE" in line]
    assert not complaints
    title = re.search(r"<title>(\{.*?\})</title>", run.stdout, re.S)
    assert title, "the page did not finish loading"
    seen = json.loads(title.group(1).replace("&amp;", "&"))
    assert seen["pictures"] == [len(p) for p in embedded_pictures(probed.read_text(encoding="utf-8"))]
    assert len(seen["figures"]) == 14
    assert all(w > 200 and h > 150 and marks > 5 for w, h, marks in seen["figures"])
    assert seen["requests"] == []
    # nothing sticks out of the window: wide figures and tables scroll by themselves
    assert seen["wide"] <= seen["window"]
    assert seen["outside"] == []
