"""The library cma is loaded without pyplot, and is none the less whole."""

import json
import subprocess
import sys

# In a process of its own: this one has loaded cma long ago.
SCRIPT = """
import json, sys
from besman.search.cma_es import CmaEs
import numpy as np

search = CmaEs(np.zeros(3), 0.5, None, (0,))
for _ in range(3):
    points = search.ask()
    search.tell(points, -(points**2).sum(axis=1))
search.exhausted
heavy = [name for name in ("matplotlib", "scipy.stats") if name in sys.modules]
finders = [type(finder).__name__ for finder in sys.meta_path]

import cma
import matplotlib.pyplot
same = [cma.s.figsave is matplotlib.pyplot.savefig, "scipy.stats" in sys.modules]
model = cma.fitness_models.LQModel.__module__
print(json.dumps([heavy, finders, same, model, "scipy.stats" in sys.modules]))
"""


def test_pyplot_and_scipy_stats_are_loaded_only_by_who_looks_at_them():
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True
    )
    heavy, finders, (shortcuts, too_early), model, stats = json.loads(done.stdout)
    assert heavy == []
    assert "_LaterFinder" not in finders
    assert shortcuts
    assert not too_early
    assert model == "cma.fitness_models"
    assert stats
    assert done.stderr == ""
