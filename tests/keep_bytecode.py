"""Have Python keep the bytecode of what it imports, also where the environment says not to.

Rewriting the asserts of all tests takes every worker six seconds, compiling besman every process
that a test starts one. Bytecode lies where Python has it, beside the compiled kernels.
"""

import os
import sys

sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
