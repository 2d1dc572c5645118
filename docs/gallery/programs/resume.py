"""
Resume after a kill
===================

A compression is killed after three seconds, and resumed from its last checkpoint. The result has the same bits as that of a
run without interruption.
"""

import subprocess
import sys
import time

import jamshape as js

command = "compress --alpha 2 --n 64 --phi-start 0.6 --kappa 2e-5 --out killed.h5"
process = subprocess.Popen([sys.executable, "-m", "jamshape", *command.split()])
time.sleep(4)
process.kill()
process.wait()
print(js.load("killed.h5"))
print(js.resume("killed.h5", progress=False))
js.plot(js.load("killed.h5"))
