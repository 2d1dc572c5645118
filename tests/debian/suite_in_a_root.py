"""Set up jamshape on a bare Debian in a folder, and run its tests there.

    python3 tests/debian/suite_in_a_root.py --root /var/tmp/trixie
    python3 tests/debian/suite_in_a_root.py --root /var/tmp/bookworm --release bookworm
    python3 tests/debian/suite_in_a_root.py --root /var/tmp/forky --release forky
    python3 tests/debian/suite_in_a_root.py --root /var/tmp/trixie -- tests/styles -x

As root, where `debootstrap`, `git` and `unshare` are; half an hour on two cores, and 4 GB. debootstrap makes a smallest
Debian in the folder, the newest commit of this clone is checked out there, and `./run setup` and `./run test` run in it
by `chroot`. A folder that is there already is used again: its Debian is upgraded, so that a release in the making is
that of today, and only what has changed is installed and compiled. What
runs has its own table of mounts and of processes, which go when it ends, in whatever way. Variables of the environment
for proxies, pip and OpenBLAS are passed on. The folder stays; it can be removed with `rm -r`. In the end a deck
compresses rods through jamming there and, if this clone is set up, here, and the positions that both write are compared.
"""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections import deque
from pathlib import Path

CLONE = Path(__file__).resolve().parents[2]
INSIDE = "root/jamshape"  # the clone in the folder
CERTIFICATES = "root/certificates.pem"
RELEASES = {"bookworm": "12", "trixie": "13", "forky": "14"}
SCRIPTS = Path("/usr/share/debootstrap/scripts")
MIRROR = "http://deb.debian.org/debian"
ADVICE = "see that there is a network, or name another mirror with --mirror"

PASSED_ON = re.compile(
    r"(https?|no)_proxy|PIP_(INDEX_URL|EXTRA_INDEX_URL|TRUSTED_HOST|DEFAULT_TIMEOUT|RETRIES)|OPENBLAS_\w+",
    re.IGNORECASE,
)
OF_CERTIFICATES = ("PIP_CERT", "REQUESTS_CA_BUNDLE", "SSL_CERT_FILE")

# In mount and process namespaces of its own: nothing of this is seen outside, or stays.
ENTER = """
mount -t proc proc "$1/proc" && mount --rbind /sys "$1/sys" && mount --rbind /dev "$1/dev" || exit 70
root=$1; shift
chroot "$root" "$@"
"""

DECK = ("-in", "inputs/compress_spherocylinder.in", "-log", "none", "-screen", "none")
DECK += ("-var", "n", "64", "-var", "kappa", "2e-3", "-var", "phi_end", "0.86", "-var", "out")
POSITIONS = "build/deck.dump"

VERSIONS = (
    ("LAMMPS", "dpkg-query -W -f '${Version}' lammps"),
    ("Open MPI", "dpkg-query -W -f '${Version}' openmpi-bin"),
    ("g++", "g++ -dumpfullversion"),
    ("Python", "/usr/bin/python3 -c 'import platform; print(platform.python_version())'"),
    ("numpy", ".venv/bin/python -c 'import numpy; print(numpy.__version__)'"),
)


AS_ROOT = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}


class UnexpectedError(Exception):
    """Unexpected result: found, expected, and what to do."""


def require(condition, sentence):
    if not condition:
        raise UnexpectedError(sentence)


def said_by(*words, **more):
    """Run a program and show what it says; return how it ended, and the last lines."""
    last = deque(maxlen=20)
    with subprocess.Popen(
        [str(word) for word in words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        **more,
    ) as process:
        try:
            for line in process.stdout:
                print(line, end="", flush=True)
                last.append(line.strip())
            process.wait()
        finally:  # also when interrupted: with `unshare` ends all that runs inside
            if process.poll() is None:
                process.kill()
    return process.returncode, list(last)


# --- the folder -----------------------------------------------------------------------------------


def bootstrap(root, release, mirror):
    """Make a smallest Debian in a new folder; one that is there must be of the release."""
    if root.is_dir() and any(root.iterdir()):
        require_release(root, release)
        return False
    # A release younger than this debootstrap is made as unstable is.
    like = () if (SCRIPTS / release).exists() else (SCRIPTS / "sid",)
    code, last = said_by("debootstrap", "--variant=minbase", release, root, mirror, *like)
    told = last[-1] if last else "no word"
    require(code == 0, f"debootstrap ended with '{told}', expected {release} in {root}: {ADVICE}")
    return True


def require_release(root, release):
    system = root / "etc" / "os-release"
    found = system.read_text() if system.is_file() else ""
    [name] = re.findall(r"^VERSION_CODENAME=(\w+)", found, re.MULTILINE) or ["no Debian"]
    if (root / "debootstrap").exists():  # which debootstrap removes in the end
        name = "half a Debian"
    require(
        name == release,
        f"found {name} in {root}, expected {release} or no such folder: remove it, or name another one",
    )


def take_network(root):
    """Let programs inside find hosts as they are found here, and trust whom is trusted here."""
    # Mirrors that lag, and snapshots, of a release in the making are older than a week.
    settings = root / "etc" / "apt" / "apt.conf.d" / "90jamshape"
    settings.write_text('Acquire::Check-Valid-Until "false";\n')
    shutil.copyfile("/etc/resolv.conf", root / "etc" / "resolv.conf")
    named = [os.environ[name] for name in OF_CERTIFICATES if name in os.environ]
    if named:
        shutil.copyfile(named[0], root / CERTIFICATES)


def take_clone(root):
    """Check out the newest commit of this clone, beside what an earlier one has built; return its number."""
    git = ("git", "-C", root / INSIDE)
    commands = [
        ("git", "init", "-q", root / INSIDE),
        (*git, "fetch", "-q", "--depth", "1", f"file://{CLONE}", "HEAD"),
        (*git, "checkout", "-q", "--force", "--detach", "FETCH_HEAD"),
    ]
    for words in commands:
        code, last = said_by(*words)
        told = last[-1] if last else "no word"
        require(code == 0, f"git ended with '{told}', expected {CLONE} to be a clone with commits")
    done = subprocess.run(
        [*git, "log", "-1", "--format=%h"], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def upgrade(root):
    """Bring the packages of an earlier run to the state of today."""
    for words in (("update", "-q"), ("dist-upgrade", "-qy", "--no-install-recommends")):
        code, last = said_by(
            *inside(root, "apt-get", *words),
            env=environment() | {"DEBIAN_FRONTEND": "noninteractive"},
        )
        told = last[-1] if last else "no word"
        require(
            code == 0, f"apt-get {words[0]} ended with '{told}' in {root}, expected 0: {ADVICE}"
        )


# --- inside ---------------------------------------------------------------------------------------


def environment():
    """Make the variables for programs inside: few, and those that are passed on."""
    passed_on = {name: x for name, x in os.environ.items() if PASSED_ON.fullmatch(name)}
    own = {
        "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin",
        "HOME": "/root",
        "LANG": "C.UTF-8",
    }
    if any(name in os.environ for name in OF_CERTIFICATES):
        own["PIP_CERT"] = f"/{CERTIFICATES}"
    return passed_on | own


def inside(root, *words):
    """Make the words of a command in the clone inside the folder."""
    entered = ("unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", ENTER, "enter")
    return [*entered, str(root), "sh", "-c", 'cd "$0" && exec "$@"', f"/{INSIDE}", *words]


def run_there(root, *words):
    """Run a part of `run` inside; return how it ended, its last lines and its seconds."""
    began = time.monotonic()
    code, last = said_by(*inside(root, "./run", *words), env=environment())
    return code, last, time.monotonic() - began


def told_by(root, command):
    done = subprocess.run(
        inside(root, "sh", "-c", command),
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout.strip() or "none"


def minutes(seconds):
    return f"{seconds // 60:.0f} min {seconds % 60:.0f} s"


def difference(one, other):
    """Tell by how much the numbers of two dumps differ."""
    # Some versions end lines with a blank; words that are no numbers are headings.
    here, there = (path.read_text().split() for path in (one, other))
    if here == there:
        return f"the same bits in {len(here)} words"
    off = [abs(float(a) - float(b)) for a, b in zip(here, there, strict=True) if a != b]
    return f"{len(off)} of {len(here)} numbers differ, by {max(off):.1e} at most"


def compared_deck(root):
    """Run the deck in both clones and tell whether the numbers of their dumps agree."""
    if not (CLONE / ".venv").exists():
        return "not run here, where ./run setup was not"
    words = ("lmp", *DECK, POSITIONS.removesuffix(".dump"))
    subprocess.run(inside(root, *words), env=environment() | AS_ROOT, check=True)
    (CLONE / "build").mkdir(exist_ok=True)
    subprocess.run(words, cwd=CLONE, env=os.environ | AS_ROOT, check=True)
    return difference(CLONE / POSITIONS, root / INSIDE / POSITIONS)


def set_up_and_test(root, options):
    """Do all of it, print what came of it, and return whether it went well."""
    began = time.monotonic()
    is_new = bootstrap(root, options.release, options.mirror)
    bootstrapped = minutes(time.monotonic() - began) if is_new else "was there"
    take_network(root)
    commit = take_clone(root)
    if not is_new:
        upgrade(root)
    code, _, seconds = run_there(root, "setup")
    require(code == 0, f"./run setup ended with {code} in {root}, expected 0: see above")
    set_up = minutes(seconds)
    code, last, seconds = run_there(root, "test", *options.words)
    versions = ", ".join(f"{name} {told_by(root, command)}" for name, command in VERSIONS)
    print(f"\n== Debian {RELEASES[options.release]} in {root}, commit {commit}")
    print(f"   {versions}")
    print(f"   debootstrap   {bootstrapped}")
    print(f"   ./run setup   {set_up}")
    print(f"   ./run test    {minutes(seconds)}: {last[-1].strip('= ') if last else 'nothing'}")
    print(f"   deck          {compared_deck(root)}")
    require(code == 0, f"./run test ended with {code} in {root}, expected 0: see above")


def require_tools(root):
    require(os.geteuid() == 0, "found no root, expected it, to make and enter a system; use sudo")
    for name in ("debootstrap", "git", "unshare", "chroot"):
        require(
            shutil.which(name),
            f"found no {name}, expected it: run 'apt-get install debootstrap git util-linux'",
        )
    require(
        root not in (Path("/"), *CLONE.parents, CLONE) and CLONE not in root.parents,
        f"found {root} for --root, expected a folder apart from this clone: name another one",
    )


def main():
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, required=True, help="folder, new or of an earlier run")
    parser.add_argument("--release", choices=RELEASES, default="trixie", help="(trixie)")
    parser.add_argument("--mirror", metavar="URL", default=MIRROR, help=f"of packages ({MIRROR})")
    parser.add_argument("words", nargs="*", help="go to ./run test, behind --")
    options = parser.parse_args()
    root = options.root.resolve()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("suite_in_a_root.py: ended by a signal."))
    try:
        require_tools(root)
        set_up_and_test(root, options)
    except (UnexpectedError, OSError) as error:
        sys.exit(f"suite_in_a_root.py: {error}.")
    except KeyboardInterrupt:
        sys.exit("suite_in_a_root.py: interrupted; start it again to go on.")


if __name__ == "__main__":
    main()
