"""What compiled code needs of the disk."""

import os
import resource
import subprocess
import sys
from pathlib import Path

MOST = 200  # bytes in a file: less than any compiled function takes
ROOT = "from emir_plant.jit import square_root; print(square_root(4.0))"


def test_compiled_code_runs_where_the_disk_has_no_room_to_keep_it(tmp_path: Path) -> None:
    """A limit on a file's size stands for the end of the disk, as the system tells both."""
    finished = subprocess.run(
        [sys.executable, "-c", ROOT],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (MOST, MOST)),
    )
    assert finished.stdout.split() == ["2.0"], finished.stderr
    kept = [file for file in tmp_path.rglob("*") if file.suffix == ".nbc"]
    assert not kept  # else the disk had room
