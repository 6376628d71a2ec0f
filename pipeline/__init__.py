"""seatrial: from the raw logs of an underwater-glider field trial to a validated flight model.

``pipeline.analyse(folder)`` analyses one mission in memory, see `pipeline.analysis`; it is imported when asked for.
"""

import hashlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline.analysis import Trial, analyse

__all__ = ["Trial", "__version__", "analyse"]

__version__ = "0.1.0"

#: Days after which compiled kernels that nobody has used are removed, once others are made beside them.
_KEPT = 7.0


def __getattr__(name: str) -> Any:
    """Return `analyse` or `Trial`, which import all stages, when they are first asked for (PEP 562)."""
    if name not in ("Trial", "analyse"):
        raise AttributeError(f"module 'pipeline' has no attribute '{name}'")
    from importlib import import_module

    return getattr(import_module("pipeline.analysis"), name)


def _kernel_folder() -> Path:
    """Return the folder of compiled kernels that belongs to the sources as they are.

    numba keeps a compiled kernel until its own file changes, even if a kernel that it calls, in another file, has
    changed: results would be those of code that is no more. So the folder is named after all sources with kernels.
    It lies beside them, in the user's cache where that cannot be written, or else is temporary. Those of other sources
    go a week after they were last used.
    """
    here = Path(__file__).parent
    sources = (path.read_bytes() for path in sorted(here.rglob("*.py")))
    kernels = b"".join(source for source in sources if b"njit" in source or b"NamedTuple" in source)
    name = f"kernels-{hashlib.blake2b(kernels, digest_size=8).hexdigest()}"
    for place in (here / "__pycache__", Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache", "seatrial")):
        try:
            folder = place.expanduser() / name
            new = not folder.is_dir()
            folder.mkdir(parents=True, exist_ok=True)
            os.utime(folder)
            if new:
                _sweep(folder.parent)
        except (OSError, RuntimeError):  # RuntimeError: a user without a home
            continue
        if os.access(folder, os.W_OK):
            return folder
    return _temporary()


def _sweep(place: Path) -> None:
    """Remove folders of compiled kernels that were not used for `_KEPT` days."""
    import shutil
    import time

    for folder in place.glob("kernels-*"):
        if folder.stat().st_mtime < time.time() - 86400.0 * _KEPT:
            shutil.rmtree(folder, ignore_errors=True)


def _temporary() -> Path:
    """Return a new folder that goes when this process ends."""
    import atexit
    import shutil
    import tempfile

    folder = tempfile.mkdtemp(prefix="seatrial-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


if "NUMBA_CACHE_DIR" not in os.environ:
    os.environ["NUMBA_CACHE_DIR"] = str(_kernel_folder())
