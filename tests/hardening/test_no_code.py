"""Data are data: nothing in a file is run, unpickled or fetched, no other file is read, and no page runs a name."""

from __future__ import annotations

import ast
import html.parser
import json
import os
import pickle
import re
import zipfile
from pathlib import Path

import h5py
import numpy as np
import pytest
from hardening_tools import SCENE

import vgonio as vg
from vgonio import materials, measure
from vgonio.compare.fit_files import open_fit
from vgonio.errors import FileFormatError, MaterialError, VgonioError
from vgonio.scene import load_scene
from vgonio.studies.stored import read_point

PACKAGE = Path(vg.__file__).parent


class Bomb:
    """Unpickled, it makes the file that its class is told."""

    path = ""

    def __reduce__(self):
        return os.mkdir, (Bomb.path,)


@pytest.fixture
def went_off(tmp_path):
    """A path that exists as soon as something in a file was run."""
    Bomb.path = str(tmp_path / "went off")
    yield tmp_path / "went off"
    assert not (tmp_path / "went off").exists()


# ---- calls that could
BANNED_NAMES = {"eval", "exec", "compile", "__import__"}
BANNED_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal", "code", "runpy", "imp"}
# what a module may be imported by, other than by name: tables of our own
DYNAMIC = {"__init__.py", "report/__init__.py", "measure/__init__.py", "wave/fourier.py", "models/registry.py"}
# fixed programs in processes of their own; never a text of a file
PROCESSES = {"cli/doctor.py", "render/variants.py", "accuracy/trials.py"}


def calls(path: Path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            yield node, ast.unparse(node.func)


def sources():
    return sorted(PACKAGE.rglob("*.py"))


def test_no_module_can_run_what_it_reads():
    """No eval, no pickle, no unsafe loader; importlib, subprocess and np.load where they are known to be harmless."""
    seen = set()
    for path in sources():
        place = path.relative_to(PACKAGE).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                names = {a.name for a in node.names} | {getattr(node, "module", "") or ""}
                roots = {n.split(".")[0] for n in names}
                assert not roots & BANNED_MODULES, (place, node.lineno)
                if "subprocess" in roots:
                    assert place in PROCESSES, (place, node.lineno)
        for node, name in calls(path):
            last = name.rpartition(".")[2]
            keywords = {k.arg: ast.unparse(k.value) for k in node.keywords}
            where = (place, node.lineno, name)
            assert name not in BANNED_NAMES, where
            assert name not in ("os.system", "os.popen"), where
            assert keywords.get("allow_pickle", "False") == "False", where
            assert keywords.get("shell", "False") == "False", where
            assert name not in ("yaml.load", "yaml.unsafe_load", "yaml.full_load", "yaml.load_all"), where
            assert last not in ("read_pickle", "load_module", "exec_module"), where
            if last == "import_module":
                assert place in DYNAMIC, where
            seen.add(name)
    assert {"yaml.safe_load", "np.load"} <= seen  # the search sees what there is


def test_the_ban_finds_what_it_bans(tmp_path):
    (tmp_path / "a.py").write_text("import yaml\nyaml.load(open('x'))\n")
    assert [name for _, name in calls(tmp_path / "a.py")] == ["yaml.load", "open"]


# ---- files that try
def _npy(array: np.ndarray) -> bytes:
    from io import BytesIO

    stream = BytesIO()
    np.lib.format.write_array(stream, array, allow_pickle=True)
    return stream.getvalue()


def _archive(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return path


def test_pickles_are_not_loaded(tmp_path, went_off):
    bomb = _npy(np.array([Bomb()], dtype=object))
    assert b"mkdir" in bomb
    z = _npy(np.zeros((3, 3)))
    for path in (
        _archive(tmp_path / "z.npz", z=bomb),
        _archive(tmp_path / "name.npz", z=z, pitch_um=_npy(np.array(1.0)), name=bomb),
        _archive(tmp_path / "meta.npz", z=z, pitch_um=bomb),
    ):
        with pytest.raises(FileFormatError):
            vg.surface.read(path)
    for suffix in ("npy", "mat", "csv", "txt", "nc", "json", "vgms", "x3p"):
        (tmp_path / f"p.{suffix}").write_bytes(pickle.dumps(Bomb()))
        for read in (vg.surface.read, measure.read, vg.open):
            with pytest.raises(FileFormatError):
                read(tmp_path / f"p.{suffix}")


def test_a_part_of_a_validation_is_not_unpickled(tmp_path, went_off):
    from vgonio.render.normbox.predict import _kept

    assert _kept(_archive(tmp_path / "part.npz", spectra=_npy(np.array([Bomb()], dtype=object)))) is None


@pytest.mark.parametrize(
    "tag", ["!!python/object/apply:os.mkdir", "!!python/object/new:os.mkdir", "!!python/name:os.mkdir"]
)
def test_yaml_makes_no_objects(tmp_path, went_off, tag):
    path = tmp_path / "a.yml"
    path.write_text(f"DATA:\n  - type: tabulated nk\n    data: {tag} ['{went_off}']\n")
    with pytest.raises(FileFormatError):
        materials.material(path)


def test_a_yaml_of_many_aliases_is_small(tmp_path):
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 12)]
    (tmp_path / "a.yml").write_text("\n".join([*lines, "DATA: *a11"]))
    with pytest.raises(FileFormatError) as caught:
        materials.material(tmp_path / "a.yml")
    assert len(str(caught.value)) < 1500


def test_hdf5_objects_are_not_unpickled(tmp_path, went_off, result):
    """An attribute and a variable that hold a pickle as bytes, as HDF5 has no other place for one."""
    path = vg.save(result, tmp_path / "r.nc")
    with h5py.File(path, "a") as file:
        file.attrs["scene"] = np.void(pickle.dumps(Bomb()))
        file["rays"].create_dataset("code", data=np.void(pickle.dumps(Bomb())))
    for read in (vg.open, read_point):
        try:
            read(path)
        except FileFormatError:
            pass


LINKS = {
    "external link": lambda file, other: file.__setitem__("rays/more", h5py.ExternalLink(str(other), "/secret")),
    "external group": lambda file, other: file.__setitem__("more", h5py.ExternalLink(str(other), "/")),
    "virtual data set": lambda file, other: file.create_virtual_dataset("more", _layout(other)),
    "external storage": lambda file, other: file.create_dataset("more", (8,), "u1", external=[(str(other), 0, 8)]),
    "soft link to one": lambda file, other: (
        file.__setitem__("hidden", h5py.ExternalLink(str(other), "/secret")),
        file.__setitem__("more", h5py.SoftLink("/hidden")),
    ),
    "a group in itself": lambda file, other: file["rays"].__setitem__("more", file["rays"]),
    "a circle": lambda file, other: file["rays"].__setitem__("more", file["/"]),
}


def _layout(other: Path) -> h5py.VirtualLayout:
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource(str(other), "secret", (3,))
    return layout


@pytest.mark.parametrize("kind", LINKS)
def test_hdf5_reads_no_other_file(tmp_path, result, kind):
    """Every way that HDF5 has to reach into another file, or round in a circle, in a result, a fit and a surface."""
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["secret"] = np.arange(3.0)
    path = vg.save(result, tmp_path / "r.nc")
    with h5py.File(path, "a") as file:
        LINKS[kind](file, tmp_path / "secret.h5")
    for read in (vg.open, measure.read, open_fit, read_point):
        with pytest.raises(FileFormatError, match="other file|another file|holds itself"):
            read(path)
    with pytest.raises(FileFormatError, match="is a result, and a height field is needed"):
        vg.surface.read(path, pitch_um=1)  # refused by its bytes, before HDF5 opens it
    with h5py.File(tmp_path / "plain.h5", "w") as file:
        file.create_group("rays")
        LINKS[kind](file, tmp_path / "secret.h5")
    with pytest.raises(FileFormatError, match="other file|another file|holds itself"):
        vg.surface.read(tmp_path / "plain.h5", pitch_um=1)
    matlab = tmp_path / "a.mat"  # HDF5 behind a head of 512 bytes
    with h5py.File(matlab, "w", userblock_size=512) as file:
        file.create_group("rays")
        LINKS[kind](file, tmp_path / "secret.h5")
    with matlab.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")
    with pytest.raises(FileFormatError, match="other file|another file|holds itself"):
        vg.surface.read(matlab, pitch_um=1)


def test_a_scene_reads_the_files_it_names_and_no_variables(tmp_path, monkeypatch):
    """Paths may lead anywhere the user may read, as in any tool; they are not expanded by a shell."""
    monkeypatch.setenv("SECRET", "x")
    scene = load_scene({"surface": {"file": "../a/$SECRET/`id`/{0.__class__}/%s.npz"}})
    assert scene.inputs[0].parts[-4:] == ("$SECRET", "`id`", "{0.__class__}", "%s.npz")
    with pytest.raises(VgonioError):
        vg.simulate({"surface": {"file": "http://example.com/a.npz"}})
    with pytest.raises((FileFormatError, MaterialError)):
        materials.material("http://example.com/a.yml")


def test_a_pattern_of_a_validation_is_no_format_string():
    from vgonio.errors import InputError
    from vgonio.render.normbox.inputs import _numbered

    assert _numbered("patch_{number:02d}.json", 3) == "patch_03.json"
    assert _numbered("{number}/{number:03d}.json", 3) == "3/003.json"
    for pattern in ("{number.__class__}", "{number:999999999d}", "{0}", "patch.json"):
        with pytest.raises(InputError, match="is needed"):
            _numbered(pattern, 3)


# ---- pages
EVIL = "<script>alert(1)</script><img src=x onerror=alert(2)> \"'><svg onload=alert(3)> $\\frac{ </script> ]]> {{7*7}}"


class Page(html.parser.HTMLParser):
    """Elements and attributes of a page that run something."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.scripts, self.handlers, self.images = 0, [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.scripts += tag == "script"
        self.handlers += [(tag, k) for k, v in attrs if k.startswith("on") or "javascript:" in (v or "")]
        self.images += [v for k, v in attrs if k in ("src", "href", "xlink:href") and re.match(r"\w+:|//", v or "")]


def _evil_files(folder: Path) -> dict:
    """A surface, a material and a measurement whose names and notes are scripts."""
    name = "<img src=x onerror=alert(4)> $\\frac{"
    rough = vg.surface.gaussian(rms_um=0.2, correlation_um=3.0, shape=(16, 16), pitch_um=1.0, seed=1)
    evil = vg.surface.Heightfield(rough.z, 1.0, name=EVIL, history=(EVIL,), meta={"instrument": EVIL})
    surface = vg.surface.write(evil, folder / f"{name}.npz")
    (folder / f"{name}.yml").write_text(
        "DATA:\n  - type: tabulated nk\n    data: |\n      0.3 0.5 4\n      0.9 1.8 8\n"
    )
    rows = [{"wavelengths": [450, 550], "comment": EVIL, "provenance": EVIL, EVIL: EVIL}]
    rows += [
        {"thetaIn": i, "phiIn": 0, "thetaOut": abs(o), "phiOut": 0 if o >= 0 else 180, "spectrum": [0.2, 0.3]}
        for i in (0, 30, 60)
        for o in (-30, 0, 30)
    ]
    (folder / f"{name}.json").write_text(json.dumps(rows))
    return {"surface": {"file": str(surface)}, "material": {"file": f"{folder / name}.yml"}, "measured": {
        "file": f"{folder / name}.json"}}  # fmt: skip


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, tuple[str, str]]:
    """Each page of a harmless scene and of one whose every text is a script."""
    import tomllib
    import warnings

    from vgonio.report.explorer import explorer_page

    found: dict[str, list[str]] = {"report": [], "explorer": []}
    for kind in ("plain", "evil"):
        folder = tmp_path_factory.mktemp(kind)
        scene = tomllib.loads(SCENE) | {"wave": {"tol": 0.1}}
        files = _evil_files(folder)
        if kind == "plain":
            for table in files.values():
                new = Path(table["file"]).with_name("plain" + Path(table["file"]).suffix)
                Path(table["file"]).rename(new)
                table["file"] = str(new)
            (folder / "plain.json").write_text((folder / "plain.json").read_text().replace(json.dumps(EVIL), '"x"'))
            vg.surface.write(vg.surface.Heightfield(vg.surface.read(folder / "plain.npz").z, 1.0), folder / "plain.npz")
        scene |= files | {"title": EVIL if kind == "evil" else "plain"}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = vg.simulate(scene, output=folder / "r.nc", report=folder / "r.html")
            tree = vg.open(folder / "r.nc")
            explorer_page(tree, folder / "e.html")
        found["report"].append((folder / "r.html").read_text(encoding="utf-8"))
        found["explorer"].append((folder / "e.html").read_text(encoding="utf-8"))
    return {k: (v[0], v[1]) for k, v in found.items()}


@pytest.mark.parametrize("page", ["report", "explorer"])
def test_names_and_notes_of_files_are_shown_and_not_run(pages, page):
    plain, evil = (Page(text) for text in pages[page])
    assert "alert(1)" in pages[page][1]  # the names are there
    assert evil.scripts == plain.scripts
    assert evil.handlers == plain.handlers  # the explorer's own form has one
    assert evil.images == plain.images
    assert "49" not in re.findall(r"\{\{7\*7\}\}|>49<", pages[page][1])
