import subprocess
import sys

import pytest
from exchanged import mixed

from jamshape.exchange.freud import to_freud
from jamshape.exchange.gsd import write_gsd
from jamshape.exchange.mdanalysis import to_mdanalysis
from jamshape.exchange.ovito import to_ovito

TOOLS = {
    "gsd.hoomd": ("gsd", lambda packing, folder: write_gsd(folder / "x.gsd", packing)),
    "freud": ("freud-analysis", lambda packing, _: to_freud(packing)),
    "ovito.data": ("ovito", lambda packing, _: to_ovito(packing)),
    "MDAnalysis": ("MDAnalysis", lambda packing, _: to_mdanalysis(packing)),
}


@pytest.mark.parametrize("module", TOOLS)
def test_a_tool_that_is_missing_is_named_with_what_installs_it(module, monkeypatch, tmp_path):
    package, export = TOOLS[module]
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(
        ImportError, match=f"{module} cannot be imported .* pip install '{package}'"
    ):
        export(mixed("dimer", 2), tmp_path)
    assert not list(tmp_path.iterdir())


def test_no_tool_is_imported_before_it_is_used():
    names = ("gsd", "freud", "ovito", "mdanalysis")
    imports = "; ".join(f"import jamshape.exchange.{name}" for name in names)
    code = f"{imports}; import sys; print(sorted({{'gsd', 'freud', 'ovito', 'MDAnalysis'}} & {{*sys.modules}}))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout.strip() == "[]"
