"""
Resume after a kill
===================

A compression is killed while it runs, and resumed from its last checkpoint. The result has the same bits as that of a
run without interruption.
"""

import subprocess
import sys
import time
from pathlib import Path

import matplotlib.pyplot as plt

import jamshape as js

options = "--alpha 2 --n 256 --phi-start 0.5 --kappa 3e-5 --out killed.h5"
command = [sys.executable, "-m", "jamshape", "compress", *options.split()]
process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
while process.poll() is None and not (Path("killed.h5").exists() and len(js.load("killed.h5")) > 3):
    time.sleep(0.1)
process.kill()
process.wait()
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
js.plot(js.load("killed.h5"), left)
js.plot(js.resume("killed.h5", progress=False), right)
