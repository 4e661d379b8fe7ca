"""Make the notebooks of this folder from the scripts of ../examples, executed, with their outputs.

    python notebooks/make.py            # all
    python notebooks/make.py 01 03      # these

A script `examples/NN_name.py` in jupytext's percent format (`# %%` begins a cell, `# %% [markdown]` one of text) is the
one source of `notebooks/NN_name.ipynb`; edit the script, not the notebook. A notebook whose cells fail, write to
standard error or print a path of this machine is not stored.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from nbclient import NotebookClient
from traitlets.config import Config

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parent / "examples"
MARK = "# %% [markdown]\n"  # how a script begins that is a notebook, too
TIMEOUT_S = 300
METADATA = {
    "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
    "language_info": {"name": "python"},
}


def scripts() -> list[Path]:
    """The examples that are notebooks, too."""
    return [p for p in sorted(EXAMPLES.glob("[0-9][0-9]_*.py")) if p.read_text(encoding="utf-8").startswith(MARK)]


def notebook_of(script: Path) -> Path:
    return HERE / f"{script.stem}.ipynb"


def converted(script: Path) -> nbformat.NotebookNode:
    """The script as a notebook without outputs; the same script gives the same bytes."""
    made = jupytext.read(script, fmt="py:percent")
    made.metadata = nbformat.from_dict(METADATA)
    for number, cell in enumerate(made.cells, 1):
        cell["id"] = f"cell-{number:02d}"
        cell.metadata = nbformat.from_dict({})
    return made


def connection(folder: str) -> Config:
    """Files in place of ports, where the system has such sockets: kernels that start at once cannot take the same."""
    files = {"transport": "ipc", "ip": str(Path(folder, "kernel"))}
    return Config({"ConnectionFileMixin": files} if os.name == "posix" else {})


def execute(notebook: nbformat.NotebookNode, timeout: float = TIMEOUT_S) -> None:
    """Run all cells in a fresh kernel, in the folder of the notebooks; raises CellExecutionError where one fails."""
    with tempfile.TemporaryDirectory() as sockets:
        client = NotebookClient(
            notebook,
            timeout=timeout,
            startup_timeout=timeout,
            iopub_timeout=timeout,  # an output that comes late is still an output
            kernel_name="python3",
            record_timing=False,
            coalesce_streams=True,
            resources={"metadata": {"path": str(HERE)}},
            config=connection(sockets),
        )
        client.execute()
    notebook.metadata = nbformat.from_dict(METADATA)  # the kernel names its exact version


def texts(notebook: nbformat.NotebookNode) -> list[tuple[str, str]]:
    """(stream or MIME type, text) of every output that is not a picture."""
    found: list[tuple[str, str]] = []
    for output in (o for cell in notebook.cells if cell.cell_type == "code" for o in cell.outputs):
        parts: dict[str, Any] = {output.name: output.text} if output.output_type == "stream" else output.get("data", {})
        found += [(kind, str(text)) for kind, text in parts.items() if not kind.startswith("image/")]
    return found


def faults(notebook: nbformat.NotebookNode) -> list[str]:
    """What must not stand in a stored notebook: warnings, progress bars, paths of the machine it ran on."""
    found = [f"standard error: {text.strip()[:200]}" for kind, text in texts(notebook) if kind == "stderr"]
    private = {str(HERE.parent), str(Path.home()), "/tmp/"} - {"/"}
    return found + [f"a path: {text[:200]}" for _, text in texts(notebook) if any(p in text for p in private)]


def make(script: Path) -> Path:
    """Convert, execute, look through and store one notebook."""
    notebook = converted(script)
    execute(notebook)
    if wrong := faults(notebook):
        raise SystemExit(f"{script.name}: not stored, it has\n  " + "\n  ".join(wrong))
    path = notebook_of(script)
    nbformat.write(notebook, path)
    return path


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("number", nargs="*", help="01, 02, …; all without one")
    wanted = parser.parse_args(arguments).number
    chosen = [s for s in scripts() if not wanted or s.name[:2] in wanted]
    if not chosen:
        raise SystemExit(f"no example numbered {', '.join(wanted)}: there are {', '.join(s.stem for s in scripts())}")
    for script in chosen:
        path = make(script)
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
