"""The script of the README runs character by character, in a file and in a notebook."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LAB = ROOT / "tests" / "lab"


def script() -> str:
    """What the README prints."""
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    return next(block for block in blocks if block.startswith("import anytime, compiler"))


def test_script_prints_a_table_advice_and_a_result_and_writes_its_schedule(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.syspath_prepend(str(LAB))
    monkeypatch.chdir(tmp_path)
    told: dict[str, object] = {}
    exec(compile(script(), "README.md", "exec"), told)
    printed = capsys.readouterr().out
    lines = printed.splitlines()
    assert max(map(len, lines)) <= 100
    assert lines[0].startswith("program navigate(image, start, goal) = find_path(see(image)")
    assert lines[1].split() == ["budget", "see", "find_path", "promised", "95", "%"]
    assert len([line for line in lines if line.endswith("]")]) == 6
    assert "brings navigate in 100.0 ms from" in printed
    assert "see 2× faster" in printed
    assert "find_path 2× faster" in printed
    assert any(line.startswith(("COMPLETE after", "INTERRUPTED after")) for line in lines)

    import compiler

    schedule = told["schedule"]
    loaded = compiler.load(tmp_path / "navigate.schedule", modules=[told["see"], told["find_path"]])
    assert repr(loaded) == repr(schedule)


@pytest.fixture
def kernel(tmp_path, monkeypatch):
    """This interpreter as the notebook's kernel, installed nowhere."""
    from ipykernel.kernelspec import make_ipkernel_cmd

    folder = tmp_path / "jupyter" / "kernels" / "python3"
    folder.mkdir(parents=True)
    spec = {"argv": make_ipkernel_cmd(), "display_name": "Python 3", "language": "python"}
    spec["argv"][0] = sys.executable
    (folder / "kernel.json").write_text(json.dumps(spec))
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path / "jupyter"))
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    return "python3"


@pytest.mark.filterwarnings("ignore")  # of the notebook machinery, not ours
def test_tutorial_runs_and_shows_its_objects_as_pictures(kernel, tmp_path):
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(ROOT / "docs" / "tutorial.ipynb", as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        timeout=100,
        kernel_name=kernel,
        resources={"metadata": {"path": str(ROOT / "docs")}},
    )
    client.execute()
    shown = [
        output["data"]["text/html"]
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if "text/html" in output.get("data", {})
    ]
    assert len(shown) >= 3
    assert all(html.startswith("<div><svg") for html in shown)
