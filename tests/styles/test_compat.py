"""Interfaces of LAMMPS versions, also of those that no package has: compat.h takes what a version's classes have."""

from __future__ import annotations

import shutil
import subprocess

import pytest
from lammps_runs import REPOSITORY

pytestmark = pytest.mark.lammps

VERSIONS = """
#include "compat.h"
#include <cstdio>
#include <map>
#include <string>

using Creator = int (*)();
using Table = std::map<std::string, Creator>;

struct Registry {  // as LAMMPS has one for each kind of style since the summer of 2026
  Table styles;
  void set_plugin(const std::string &name, Creator creator) { styles[name] = creator; }
};

struct Old {  // a table of each instance, public arrays
  Table table, *pair_map = &table, *fix_map = &table;
  int one = 1, two = 2, nfix = 2, ncompute = 1, nregion = 3;
  int *each[2] = {&one, &two}, **fix = each, **compute = each;
  int request(Old *, int instance) { return nregion = instance; }
};
struct New {  // no tables, protected arrays
  static Registry &pair_styles() { static Registry all; return all; }
  static Registry &fix_styles() { return pair_styles(); }
  int one = 1, two = 2, requests = 0;
  std::vector<int *> list{&two, &one, &two};
  const std::vector<int *> &get_fix_list() { return list; }
  const std::vector<int *> &get_compute_list() { return list; }
  const std::vector<int *> &get_region_list() { return list; }
  void add_request(New *) { ++requests; }

 protected:
  int nfix = 0, ncompute = 0;
  int **fix = nullptr, **compute = nullptr;
  int request(New *, int) { return 0; }
};
struct Both : New {  // versions between them: deprecated interfaces beside new ones
  int nfix = 0;
  int **fix = nullptr;
  Table *fix_map = nullptr;
};

template <class Version> void tell()
{
  namespace compat = jamshape::compat;
  Version lammps;
  compat::add_style(compat::pair_styles(&lammps), "ours", [] { return 5; });
  compat::add_style(compat::fix_styles(&lammps), "ours", [] { return 7; });
  std::printf("%d:", static_cast<int>(compat::n_regions(&lammps)));
  for (const int *fix : compat::fixes(&lammps)) std::printf(" %d", *fix);
  std::printf(", %d computes,", static_cast<int>(compat::computes(&lammps).size()));
}

int main()
{
  Old old;
  New now;
  int made = 0;
  tell<Old>();
  jamshape::compat::request_list(&old, &old, 6);
  jamshape::compat::add_style(jamshape::compat::fix_styles(&old), "ours", [] { return 7; });
  made = old.table["ours"]();
  std::printf(" %d %d\\n", old.nregion, made);
  tell<New>();
  jamshape::compat::request_list(&now, &now, 6);
  std::printf(" %d %d\\n", now.requests, New::fix_styles().styles["ours"]());
  tell<Both>();
}
"""


def test_what_a_version_has_is_taken(tmp_path):
    asked = ["pkg-config", "--cflags", "liblammps"]
    found = shutil.which("mpicxx") and shutil.which("pkg-config")
    if (
        not found
        or (done := subprocess.run(asked, text=True, capture_output=True, check=False)).returncode
    ):
        pytest.skip("needs the compiler of the plugin and Debian's headers")
    styles = REPOSITORY / "lammps_plugin" / "styles"
    (tmp_path / "main.cpp").write_text(VERSIONS)
    built = subprocess.run(
        ["mpicxx", "-std=c++17", "-DLAMMPS_SMALLBIG", "-DOMPI_SKIP_MPICXX=1", "-DJAMSHAPE_LAMMPS_VERSION=20210929",
         f"-I{styles}", *done.stdout.split(), "-I/usr/include/lammps", f"-I{styles / 'lammps_headers'}", "main.cpp", "-o", "told"],
        cwd=tmp_path, text=True, capture_output=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr[-3000:]
    told = subprocess.run([tmp_path / "told"], text=True, capture_output=True, check=True).stdout
    assert told.splitlines() == [
        "3: 1 2, 1 computes, 6 7",
        "3: 2 1 2, 3 computes, 1 7",
        "3: 2 1 2, 3 computes,",
    ]
