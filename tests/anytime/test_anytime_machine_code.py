"""Machine code is kept where there is a place, and made anew where there is none."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import anytime

SOURCE = Path(anytime.__file__).parent / "machine_code.py"
KERNEL = """
import os
import machine_code
double = machine_code.njit(cache=True)(lambda x: 2 * x)
folder = os.environ["NUMBA_CACHE_DIR"]
print(double(21), folder, len(os.listdir(folder)))
"""


def run(folder: Path, kernel: str = KERNEL, **environment: str) -> subprocess.CompletedProcess[str]:
    """A kernel is defined in a process that can write neither beside its source nor in its home."""
    shutil.copy(SOURCE, folder)
    (folder / "__pycache__").touch()  # a file: not even root can make a folder of it
    (folder / "kernel.py").write_text(kernel)
    kept = {name: os.environ[name] for name in ("PATH", "SYSTEMROOT") if name in os.environ}
    return subprocess.run(
        [sys.executable, "kernel.py"],
        cwd=folder,
        env=kept | {"HOME": str(folder / "__pycache__")} | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_without_a_folder_that_can_be_written_it_is_kept_for_the_process_alone(tmp_path):
    ran = run(tmp_path)
    answer, folder, count = ran.stdout.split()
    assert (answer, count) == ("42", "1")
    assert "set NUMBA_CACHE_DIR" in ran.stderr
    assert not Path(folder).exists()


def test_a_folder_that_is_named_is_used_and_left(tmp_path):
    named = tmp_path / "named"
    ran = run(tmp_path, NUMBA_CACHE_DIR=str(named))
    assert ran.stdout.split() == ["42", str(named), "1"]
    assert not ran.stderr
    assert named.exists()


def test_where_nothing_at_all_can_be_written_one_line_says_so(tmp_path):
    nowhere = "import tempfile; tempfile.tempdir = '/dev/null/no'"
    ran = run(tmp_path, f"{nowhere}\n{KERNEL}")
    assert "AnytimeError: machine code cannot be kept" in ran.stderr
    assert "set NUMBA_CACHE_DIR" in ran.stderr
