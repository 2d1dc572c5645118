"""
A sweep as a job array of Slurm
===============================

Each job of the array makes packings of its own seeds. The script is run here as Slurm does, once for each number of a job; on a cluster
``sbatch sweep.sh`` does it. ``JAMSHAPE`` is the command, here of this environment.
"""

import os
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt

Path("sweep.sh").write_text("""#!/bin/bash
#SBATCH --array=0-1 --cpus-per-task=1 --mem=1000 --time=01:00:00
$JAMSHAPE sweep --alpha 0 1 2 --n 16 --samples 3 --jobs 1 --out sweep --plot sweep.png \\
    --first-seed $((1 + 3 * SLURM_ARRAY_TASK_ID))
""")
known = os.environ | {"JAMSHAPE": f"{sys.executable} -m jamshape"}
for job in "01":
    environment = known | {"SLURM_ARRAY_TASK_ID": job}
    subprocess.run(["bash", "sweep.sh"], env=environment, check=True, capture_output=True)
figure = plt.figure(figsize=(8, 4), layout="tight")
figure.add_subplot(xticks=[], yticks=[]).imshow(plt.imread("sweep.png"))
