"""Time from the start of a process to the picture of a model, written to a file.

    python -m tests.first_pictures FOLDER

Every geometry of a folder is drawn by `halfstep render`, twice: the first run fills the driver's
cache of shaders, and the second is measured. A row has seconds of the clock, and of the processor
with all its threads. The column `read` is the processor's time until the scene is there.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

RENDER = "import sys; from halfstep.cli import main; sys.exit(main())"
READ = "import sys; from halfstep.cli import looking; from halfstep.models import load; "
READ += "load(sys.argv[1])"


def spent(*command: str) -> tuple[float, float]:
    """Seconds of the clock and of the processor that a command of Python takes.

    Raises:
        RuntimeError: the command fails; with the first line of what it says.
    """
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", *command],
        capture_output=True,
        text=True,
        check=False,
    )
    clock, after = time.perf_counter() - begin, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode:
        raise RuntimeError((done.stderr.strip() or "failed").splitlines()[-1])
    return clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def rows(folder: Path) -> Iterator[str]:
    """A line of a table for each model."""
    yield "| model | clock, s | processor, s | read, s |"
    yield "|---|--:|--:|--:|"
    with tempfile.TemporaryDirectory() as name:
        picture = str(Path(name) / "picture.png")
        for path in sorted(folder.glob("*.xml")):
            if path.stem.count("."):
                continue
            try:
                spent(RENDER, "render", str(path), "-o", picture)
                clock, processor = spent(RENDER, "render", str(path), "-o", picture)
                read = spent(READ, str(path))[1]
            except RuntimeError as error:
                yield f"| {path.stem} | {str(error)[:70]} | | |"
                continue
            yield f"| {path.stem} | {clock:.2f} | {processor:.2f} | {read:.2f} |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    for row in rows(parser.parse_args().folder):
        sys.stdout.write(f"{row}\n")
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
