"""Schedulers and workers of Dask for tests, each a process copied from one that has loaded Dask."""

import multiprocessing
import multiprocessing.forkserver
import os
import sys
from importlib import import_module

# What a worker needs besides: loading it takes each of them seconds, copying takes none.
_LOADED = ("distributed.cli.dask_scheduler", "distributed.cli.dask_worker", "dart_throws")
_LOADED += ("worker_items", "besman.stages.map.map_demonstrations", "besman.stages.refine.stage")


def _run(part, arguments, log):
    """Be a part of a cluster: `dask scheduler` or `dask worker` with its arguments."""
    file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.dup2(file, 1)
    os.dup2(file, 2)
    sys.argv = [f"dask-{part}", *arguments]
    import_module(f"distributed.cli.dask_{part}").main(arguments)


def start_part(part, arguments, log):
    """Start a part of a cluster; return its process."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(_LOADED))
    process = context.Process(target=_run, args=(part, [*map(str, arguments)], str(log)))
    process.start()
    return process


def stop_source():
    """End the process that parts are copied from, and wait for it: what they cost is then known."""
    multiprocessing.forkserver._forkserver._stop()
