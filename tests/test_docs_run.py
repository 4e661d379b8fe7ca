"""What the tutorial, the how-to pages and the README tell people to type is typed, in order.

Each page has a folder of its own with small files of the names that it uses; that of the README is empty, as a first
user's is. Before a fence a page may say
    <!-- file: NAME -->      the block is the content of that file
    <!-- into: NAME -->      the block takes the place of the table of that name in that file
    <!-- not run: REASON --> and nothing else is left out
"""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import vgonio as vg
from vgonio.cli import main
from vgonio.cli.examples import FILES

ROOT = Path(__file__).resolve().parents[1]
PAGES = ["docs/tutorial.md", *sorted(f"docs/howto/{p.name}" for p in (ROOT / "docs/howto").glob("*.md")), "README.md"]
BLOCK = re.compile(r"(?:^<!-- (file|into|not run): (.+?) -->\n)?^```(\w*)\n(.*?)^```$", re.M | re.S)
# what a page says in full, and what is typed here: fewer rays, pixels and patches, the same commands
CHEAP = {
    "rays = 2_000_000": "rays = 50_000",
    "rays=10**7": "rays=10**4",
    "stop = 700, step = 50": "stop = 700, step = 150",
    "--target-error 0.01": "--target-error 0.5 --size 24 --samples 1 --wavelengths 450:650:100",
    "-o beside.png": "-o beside.png --size 24 --samples 1 --wavelengths 450:650:100",
    "accuracy sinusoid-nufft v-groove": "accuracy v-groove",
    "vgonio accuracy -o": "vgonio accuracy v-groove --quick -o",
    "vgonio sweep study.toml ": "vgonio sweep study.toml --workers 1 --set geometric.rays=1000 ",
}
EMPTY = ("README.md",)  # pages that take no file for granted
SMALL_BOX = """
[virtual]
samples = 4
[render]
patches = [4, 19]
angles_deg = [30, 60]
wavelengths = 8
samples = 4
[errors]
repeats = 0
"""


def blocks(page: str) -> list[tuple[str, str, str, str]]:
    """(mark, its text, language, code) of the fences of a page in their order; of the README those of the program."""
    text = (ROOT / page).read_text(encoding="utf-8")
    if page == "README.md":
        text = text.split("## On the command line\n")[1].split("\n## What it does")[0]
    return [b for b in BLOCK.findall(text) if not b[3].startswith(":maxdepth")]


# ---- small files of the names that the pages use
SCENE = {
    "surface": {"generate": dict(kind="gaussian", rms_um=0.3, correlation_um=4, shape=[64, 64], pitch_um=0.5)},
    "material": {"name": "Al"},
    "light": {"wavelength_nm": [450, 550, 650], "theta_i_deg": [0, 30, 60]},
    "detector": {"theta_o_deg": {"start": -80, "stop": 80, "step": 10}},
    "geometric": {"rays": 5000},
}  # fmt: skip
REST = """
[material]
name = "Al"
[light]
wavelength_nm = [450, 550, 650]
theta_i_deg = [0, 30]
[detector]
theta_o_deg = { start = -80, stop = 80, step = 20 }
[geometric]
rays = 5000
[wave]
theory = "kirchhoff"
"""


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with every file that a page takes for granted, each small."""
    folder = tmp_path_factory.mktemp("workshop")
    assert main(["examples", str(folder), "--quiet"]) == 0
    vg.save(vg.simulate(SCENE), folder / "result.nc")
    (folder / "scene.toml").write_text('[surface]\nfile = "sample.x3p"\nfill = "interpolate"\n' + REST)
    return folder


# ---- typing
def cheap(text: str) -> str:
    for long, short in CHEAP.items():
        text = text.replace(long, short)
    return text


def shell(code: str) -> None:
    """Each `vgonio` line as a command of this process; what follows # is left away."""
    for line in code.splitlines():
        for part in line.split(" && "):
            words = shlex.split(part, comments=True)
            if words and words[:2] != ["pip", "install"]:  # tests/packaging installs
                assert words[0] == "vgonio", f"{part!r}: mark a block of other commands as not run, with the reason"
                assert main(words[1:]) == 0, part
                if words[1:3] == ["validate", "--init"]:
                    from vgonio.render.normbox import load

                    load(words[3])
                    Path(words[3]).write_text(SMALL_BOX)


def into(path: Path, table: str) -> None:
    """A table of a TOML file replaced."""
    name = re.match(r"\[\w+\]", table)[0]
    text, count = re.subn(rf"^{re.escape(name)}.*?(?=^\[)", lambda _: table + "\n", path.read_text(), flags=re.M | re.S)
    assert count == 1
    path.write_text(text)
    vg.plan(path)


@pytest.mark.parametrize("page", [p for p in PAGES if any(b[2] in ("", "python") for b in blocks(p))])
@pytest.mark.filterwarnings("ignore::vgonio.errors.VgonioWarning")
def test_a_page_does_what_it_says(page, workshop, tmp_path, monkeypatch, capsys) -> None:
    import matplotlib

    matplotlib.use("Agg")
    if "render" in page:
        pytest.importorskip("mitsuba")
    code = "".join(code for *_, code in blocks(page))
    made = re.findall(r"(?:init|-o|--report|--colours) (\S+)", code)
    made += FILES if "vgonio examples" in code else []
    for file in () if page in EMPTY else workshop.iterdir():
        if file.name not in made:
            (tmp_path / file.name).write_bytes(file.read_bytes())
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for mark, argument, language, code in blocks(page):
        if mark == "file":
            Path(argument).write_text(cheap(code))
            vg.plan(argument)
        elif mark == "into":
            into(Path(argument), code)
        elif not mark and language == "python":
            exec(compile(cheap(code), page, "exec"), names)
        elif not mark and language == "":
            shell(cheap(code))
    matplotlib.pyplot.close("all")


def test_what_is_not_run_says_why_and_what_is_cheaper_is_there() -> None:
    everything = [b for page in PAGES for b in blocks(page)]
    assert all(len(reason) > 10 for mark, reason, *_ in everything if mark == "not run")
    text = "".join(code for *_, code in everything)
    assert [long for long in CHEAP if long not in text] == []
    assert len([b for b in everything if b[2] in ("", "python") and b[0] != "not run"]) >= 10
