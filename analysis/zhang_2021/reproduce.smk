# Shear moduli of rods in the plane against pressure, by geometrical families and changes of contacts, as by J. Zhang, K. VanderWerf, C. Li,
# S. Zhang, M. D. Shattuck and C. S. O'Hern, Phys. Rev. E 104, 014901 (2021).
include: "../workflow.smk"


rule all:
    input:
        everything,


OPTIONS = f"--n {AT['n']} --pressures {AT['pressures']} --per-decade {AT['per_decade']} --runs series"

for alpha in AT["alphas"]:
    for first in range(1, AT["samples"] + 1, AT["chunk"]):
        count = min(AT["chunk"], AT["samples"] + 1 - first)
        add(
            "series",
            f"series_alpha{alpha:g}_seeds{first}to{first + count - 1}",
            f'python "$analysis/zhang_2021/compress.py" --alpha {alpha:g} --first-seed {first} --samples {count} {OPTIONS}',
        )

OF_ALL = [f"--alpha {words(AT['alphas'])} --samples {AT['samples']} {OPTIONS}"]
figure("moduli", "stress/moduli_scaling.py", [*OF_ALL, "--only-kept"], ["series"])
figure("families", "zhang_2021/families.py", OF_ALL, ["series"])
