"""The least processor there is, as the environment of a process: for Numba's kernels, NumPy's loops
and BLAS products.
"""

import os


def features():
    """What NumPy would use of this machine beyond the least that it was built for: AVX2, AVX-512
    where there is one.
    """
    from numpy._core._multiarray_umath import __cpu_dispatch__, __cpu_features__

    return [name for name in __cpu_dispatch__ if __cpu_features__.get(name)]


def environment(cache):
    """Environment of a process for that processor; its kernels are compiled into the folder
    `cache`.
    """
    least = {
        "NUMBA_CPU_NAME": "generic",
        "NPY_DISABLE_CPU_FEATURES": " ".join(features()),
        "OPENBLAS_CORETYPE": "Prescott",
    }
    return os.environ | least | {"NUMBA_CACHE_DIR": str(cache)}
