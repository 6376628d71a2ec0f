"""seatrial: from the raw logs of an underwater-glider field trial to a validated flight model."""

import hashlib
import os
from pathlib import Path

__version__ = "0.1.0"


def _kernel_folder() -> Path:
    """Return the folder of compiled kernels that belongs to the sources as they are.

    numba keeps a compiled kernel until its own file changes, even if a kernel that it calls, in another file, has
    changed: results would be those of code that is no more. So the folder is named after all sources with kernels.
    """
    here = Path(__file__).parent
    sources = (path.read_bytes() for path in sorted(here.rglob("*.py")))
    kernels = b"".join(source for source in sources if b"njit" in source or b"NamedTuple" in source)
    return here / "__pycache__" / f"kernels-{hashlib.blake2b(kernels, digest_size=8).hexdigest()}"


os.environ.setdefault("NUMBA_CACHE_DIR", str(_kernel_folder()))
