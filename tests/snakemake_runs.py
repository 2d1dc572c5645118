"""Snakemake as a process of its own, for the tests of workflows."""

import subprocess
import sys


def run_snakemake(workflow, folder, *words):
    """Run a workflow in a folder; standard error is with standard output."""
    return subprocess.run(
        [sys.executable, "-m", "snakemake", "-s", str(workflow), *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
        timeout=300,
    )
