"""With NUMBA_DISABLE_JIT=1 every module loads, and every pair of small size agrees."""

import os
import subprocess
import sys

CODE = """
import importlib, pkgutil
import numpy as np
import tbdcore

for about in pkgutil.walk_packages(tbdcore.__path__, "tbdcore."):
    if not about.name.startswith(("tbdcore.repro", "tbdcore.__main__")):
        importlib.import_module(about.name)
from tbdcore.kernels import track_cfar

assert not hasattr(tbdcore.kernels.ljipda_ai.ipda, "stats"), "it is compiled"
x, P = track_cfar.predict_cv(np.ones(4), np.eye(4), 2.0, 0.5)
y, Q = track_cfar.predict_cv_spec(np.ones(4), np.eye(4), 2.0, 0.5)
np.testing.assert_allclose(x, y)
np.testing.assert_allclose(P, Q)
import pairs_kalman, pairs_ljipda_ai, pairs_mm_pf_tbd, pairs_particles, pairs_track_cfar
import test_pairs

modules = pairs_kalman, pairs_ljipda_ai, pairs_mm_pf_tbd, pairs_particles, pairs_track_cfar
for module in modules:
    for name, kernel, spec, arguments in module.CASES[:12]:
        test_pairs.test_kernel_equals_its_specification(kernel, spec, arguments)
print("agree")
"""


def test_modules_load_and_small_pairs_agree_without_numba():
    surroundings = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    options = {"capture_output": True, "text": True, "env": surroundings}
    ran = subprocess.run([sys.executable, "-c", CODE], cwd=os.path.dirname(__file__), **options)
    assert ran.stdout == "agree\n", ran.stderr
